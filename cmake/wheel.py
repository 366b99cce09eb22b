#!/usr/bin/env python3
"""Makes a Python wheel of what cmake/bundle.sh has packed: the package `vsplat` with the library and PoCL inside, and the command.

  cmake/wheel.py BUNDLE OUTPUT_FOLDER

BUNDLE is a folder or an archive that cmake/bundle.sh has written. The wheel's name says which systems it runs on: manylinux_2_N if all
that its files need is inside, or is among the libraries of every Linux (ALLOWED) with glibc 2.N or newer; else linux. `auditwheel show`
checks the same. Prints the wheel's path."""
import argparse
import base64
import hashlib
import pathlib
import re
import stat
import subprocess
import sys
import tarfile
import tempfile
import zipfile

# What a manylinux wheel may expect of the system, and from which glibc on systems have each version of libstdc++'s symbols.
ALLOWED = re.compile(r"(libc|libm|libdl|libpthread|librt|libresolv|libutil|libnsl|libmvec|libgcc_s|libstdc\+\+|ld-linux-x86-64)\.so\.\d+$")
LIBSTDCXX = ((19, 17), (24, 27), (25, 28), (28, 31), (29, 34), (30, 35), (32, 38), (33, 39))
# Only for programs that are compiled, for a shell, or for systems older than the wheel can be installed on.
LEFT_OUT = re.compile(r"include/|bench/|model/|tests/|libc/|share/(?!doc/)|lib[^/]*/(.*/)?(cmake|pkgconfig)/")
COMMAND = """#!python
import importlib.util
import os
import sys
bundle = os.path.join(os.path.dirname(importlib.util.find_spec("vsplat").origin), "bundle")
os.execv(os.path.join(bundle, "bin", "vsplat"), ["vsplat", *sys.argv[1:]])
"""


def needs(path):
    """Returns the libraries that an ELF file needs, its own name, and the versions of symbols; nothing for another file."""
    with open(path, "rb") as file:
        if file.read(4) != b"\x7fELF":
            return set(), None, set()
    text = subprocess.run(["objdump", "-p", path], check=True, capture_output=True, text=True).stdout
    references = text.partition("Version References:")[2]
    soname = re.search(r"^\s*SONAME\s+(\S+)", text, re.M)
    return set(re.findall(r"^\s*NEEDED\s+(\S+)", text, re.M)), soname and soname[1], set(re.findall(r"\b(GLIBC|GLIBCXX)_([0-9.]+)", references))


def platform(paths):
    """Returns the wheel's platform, and says on stderr why."""
    wanted, names, versions = {}, set(), {"GLIBC": (2, 0), "GLIBCXX": (3, 4, 0)}
    for path in paths:
        libraries, soname, symbols = needs(path)
        names |= {path.name, soname}
        for library in libraries:
            wanted.setdefault(library, path.name)
        for kind, version in symbols:
            versions[kind] = max(versions[kind], tuple(map(int, version.split("."))))
    foreign = {f"{name} (for {user})" for name, user in wanted.items() if name not in names and not ALLOWED.match(name)}
    shown = ", ".join(f"{kind} {'.'.join(map(str, version))}" for kind, version in versions.items())
    print(f"wheel: needs {shown}, of the system " + ", ".join(sorted(name for name in wanted if name not in names)), file=sys.stderr)
    if foreign:
        print("wheel: neither inside nor on every system: " + ", ".join(sorted(foreign)), file=sys.stderr)
    since = [glibc for last, glibc in LIBSTDCXX if versions["GLIBCXX"] <= (3, 4, last)]
    if foreign or not since:
        return "linux_x86_64"
    return f"manylinux_2_{max(versions['GLIBC'][1], since[0])}_x86_64"


def pack(bundle, output):
    files = {}  # name in the wheel -> path, or text
    for path in sorted(p for p in bundle.rglob("*") if p.is_file()):
        name = path.relative_to(bundle).as_posix()
        if name.startswith("share/vsplat/python/"):
            files[name[len("share/vsplat/python/"):]] = path
        elif not LEFT_OUT.match(name) and not (path.is_symlink() and name.endswith(".so")):
            files["vsplat/bundle/" + name] = path
    # A wheel has no links: a library has the name by which it is loaded.
    for name, path in [item for item in files.items() if item[1].is_symlink()]:
        files.pop((pathlib.PurePosixPath(name).parent / path.resolve().name).as_posix(), None)
    if "vsplat/__init__.py" not in files:
        sys.exit(f"{bundle} holds no Python module: it is not what cmake/bundle.sh packs")
    version = re.search(r"^Version: *(\S+)", next(bundle.rglob("vsplat.pc")).read_text(), re.M)[1]
    # libcxx is for a system without libstdc++; by itself it says nothing about what the rest needs.
    tag = "py3-none-" + platform([path for name, path in files.items() if "/libcxx/" not in name])
    info = f"vsplat-{version}.dist-info"
    files[f"vsplat-{version}.data/scripts/vsplat"] = COMMAND
    files[f"{info}/METADATA"] = f"""Metadata-Version: 2.1
Name: vsplat
Version: {version}
Summary: Posed photographs to 3D Gaussian splats on any OpenCL device
License: Apache-2.0; the libraries inside have their own, in vsplat/bundle/share/doc/vsplat/libraries
Requires-Python: >=3.9
Requires-Dist: numpy
"""
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: vsplat\nRoot-Is-Purelib: false\nTag: {tag}\n"
    output.mkdir(parents=True, exist_ok=True)
    wheel = output / f"vsplat-{version}-{tag}.whl"
    record = []
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        def add(name, data, is_program):
            entry = zipfile.ZipInfo(name)  # of 1980, so that equal content gives equal bytes
            entry.external_attr = (stat.S_IFREG | (0o755 if is_program else 0o644)) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)

        for name, content in files.items():
            data = content.encode() if isinstance(content, str) else content.read_bytes()
            add(name, data, "/scripts/" in name if isinstance(content, str) else bool(content.stat().st_mode & 0o111))
            record.append(f"{name},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b'=').decode()},{len(data)}\n")
        add(f"{info}/RECORD", "".join(record) + f"{info}/RECORD,,\n", False)
    return wheel


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    args = parser.parse_args()
    if args.bundle.is_dir():
        print(pack(args.bundle, args.output))
        return
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(args.bundle) as archive:
            archive.extractall(folder)
        print(pack(pathlib.Path(folder) / "vsplat", args.output))


if __name__ == "__main__":
    main()
