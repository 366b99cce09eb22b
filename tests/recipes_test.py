"""The recipes for Conan and vcpkg (cmake/README.md) name everything that CMakeLists.txt looks for, each in its own words."""
import ast
import json
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).parent.parent
# What CMake calls it: Conan's name, vcpkg's. Tests and fuzzing are built in a checkout alone.
NAMES = {
    "Eigen3": ("eigen", "eigen3"), "fmt": ("fmt", "fmt"), "nlohmann_json": ("nlohmann_json", "nlohmann-json"), "PNG": ("libpng", "libpng"),
    "JPEG": ("libjpeg-turbo", "libjpeg-turbo"), "OpenEXR": ("openexr", "openexr"), "TIFF": ("libtiff", "tiff"), "STB_INCLUDE_DIR": ("stb", "stb"),
    "WebP": ("libwebp", "libwebp"), "EXIF": ("libexif", "libexif"), "ZIP": ("libzip", "libzip"), "OpenCL": ("opencl-icd-loader", "opencl"),
    "CLBlast": ("clblast", "clblast"), "NANOFLANN": ("nanoflann", "nanoflann"), "OpenSSL": ("openssl", "openssl"), "CLI11": ("cli11", "cli11"),
    "HDF5": ("hdf5", "hdf5"), "assimp": ("assimp", "assimp"), "draco": ("draco", "draco"),
    "meshoptimizer": ("meshoptimizer", "meshoptimizer"), "embree": ("embree3", "embree3"), "MPI": ("openmpi", "openmpi"),
    "PkgConfig": ("pkgconf", None), "GTest": None,
}


def looked_for():
    text = (ROOT / "CMakeLists.txt").read_text() + (ROOT / "runtime/CMakeLists.txt").read_text()
    return set(re.findall(r"^\s*(?:find_package|pkg_check_modules|find_path)\((\w+)", text, re.M))


class Recipes(unittest.TestCase):
    def test_all_is_known(self):
        self.assertEqual(looked_for(), set(NAMES))

    def test_conan(self):
        text = (ROOT / "cmake/conan/conanfile.py").read_text()
        ast.parse(text)
        named = set(re.findall(r'"([a-z0-9_-]+)/[^*"]+"', text))
        self.assertEqual(named, {names[0] for names in NAMES.values() if names} | {"cmake", "opencl-headers"})

    def test_vcpkg(self):
        port = json.loads((ROOT / "cmake/vcpkg/vcpkg.json").read_text())
        lists = [port["dependencies"], *(feature["dependencies"] for feature in port["features"].values())]
        named = {one if isinstance(one, str) else one["name"] for one in sum(lists, [])}
        self.assertEqual(named, {names[1] for names in NAMES.values() if names and names[1]} | {"vcpkg-cmake", "vcpkg-cmake-config"})
        version = re.search(r"project\(vsplat VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
        self.assertEqual(port["version"], version)


if __name__ == "__main__":
    unittest.main()
