"""vsplat for Conan 2, on Linux: `conan create cmake/conan --build=missing` from a checkout. Written by Conan's documentation and its center's
recipes; nobody has run it yet (cmake/README.md)."""
import os

from conan import ConanFile
from conan.errors import ConanInvalidConfiguration
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load, rmdir
from conan.tools.gnu import PkgConfigDeps

required_conan_version = ">=2.0"


class Vsplat(ConanFile):
    name = "vsplat"
    description = "Four posed photos in, a 3D Gaussian splat and novel views out, on any OpenCL device"
    license = "Apache-2.0"
    topics = ("gaussian-splatting", "opencl", "3d-reconstruction", "rendering")
    package_type = "shared-library"
    settings = "os", "arch", "compiler", "build_type"
    # data: what reads meshes and HDF5 files, and draws meshes and random objects. mpi: training on several machines.
    options = {"data": [True, False], "mpi": [True, False]}
    default_options = {"data": True, "mpi": False, "openexr/*:shared": True, "clblast/*:shared": True}

    @property
    def _checkout(self):
        return os.path.join(self.recipe_folder, "..", "..")

    def set_version(self):
        project = load(self, os.path.join(self._checkout, "CMakeLists.txt")).split("project(vsplat VERSION ")[1]
        self.version = project.split()[0]

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE", "README.md", "cl/*", "runtime/*", "model/*", "bench/*", "examples/*", "cmake/*"):
            copy(self, pattern, self._checkout, self.export_sources_folder)

    def validate(self):
        if self.settings.os != "Linux":
            raise ConanInvalidConfiguration("vsplat is built on Linux alone so far")
        check_min_cppstd(self, 20)

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        for one in ("eigen/3.4.0", "fmt/[>=9 <12]", "nlohmann_json/[>=3.11 <4]", "cli11/[>=2.3 <3]", "nanoflann/[>=1.4 <2]", "stb/cci.20230920",
                    "libpng/[>=1.6 <2]", "libjpeg-turbo/[>=2.1 <4]", "openexr/[>=3.1 <4]", "libtiff/[>=4.5 <5]", "libwebp/[>=1.2 <2]",
                    "libexif/[>=0.6.24 <1]", "libzip/[>=1.9 <2]", "openssl/[>=3 <4]", "clblast/[>=1.6 <2]", "opencl-headers/[>=2022]",
                    "opencl-icd-loader/[>=2022]"):
            self.requires(one)
        if self.options.data:
            for one in ("assimp/[>=5.2 <6]", "draco/[>=1.5 <2]", "embree3/[>=3.13 <4]", "hdf5/[>=1.10 <2]", "meshoptimizer/[>=0.18 <2]"):
                self.requires(one)
        if self.options.mpi:
            self.requires("openmpi/[>=4 <5]")

    def build_requirements(self):
        self.tool_requires("cmake/[>=3.25]")
        self.tool_requires("pkgconf/[>=2]")

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["VSPLAT_TESTS"] = False
        toolchain.cache_variables["VSPLAT_DATA"] = bool(self.options.data)
        toolchain.cache_variables["VSPLAT_MPI"] = bool(self.options.mpi)
        toolchain.cache_variables["STB_INCLUDE_DIR"] = os.path.join(self.build_folder, "stb")
        toolchain.generate()
        # The source includes it as Debian has it: <stb/stb_image.h>.
        copy(self, "stb_image.h", self.dependencies["stb"].cpp_info.includedirs[0], os.path.join(self.build_folder, "stb", "stb"))
        packages = CMakeDeps(self)
        for package, file, target in (("clblast", "CLBlast", "clblast"), ("opencl-icd-loader", "OpenCL", "OpenCL::OpenCL"),
                                      ("cli11", "CLI11", "CLI11::CLI11"), ("embree3", "embree", "embree")):
            packages.set_property(package, "cmake_file_name", file)
            packages.set_property(package, "cmake_target_name", target)
        packages.generate()
        PkgConfigDeps(self).generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))
        CMake(self).install()
        rmdir(self, os.path.join(self.package_folder, "lib", "cmake"))
        rmdir(self, os.path.join(self.package_folder, "lib", "pkgconfig"))

    def package_info(self):
        self.cpp_info.libs = ["vsplat"]
        self.cpp_info.set_property("cmake_file_name", "vsplat")
        self.cpp_info.set_property("cmake_target_name", "vsplat::vsplat")
        self.cpp_info.set_property("pkg_config_name", "vsplat")
