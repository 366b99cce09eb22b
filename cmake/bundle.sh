#!/bin/sh
# Packs a built vsplat so that it runs from any folder of a machine on which only an OpenCL driver is installed: the command, its library,
# every shared library that they need, including the OpenCL loader, and the scripts for the first runs on a GPU (bench/gpu-first-hour.sh) and
# for training there (model/weights/train-on-a-gpu.sh). The C library is packed, too, but used only if the machine's is older than this one's.
#   cmake/bundle.sh [--build DIR] [--reader] [--tests] [--limit MIB] OUTPUT
# OUTPUT is NAME.tar.xz, NAME.tar.gz (larger, but a bare machine may lack xz), or a folder that does not exist yet. DIR is the build, by
# default build/release. An archive larger than MIB (40) is an error. --reader adds the program that reads meshes and HDF5 files, with its
# libraries; training on random objects and on folders of pictures does not need it. --tests adds the kernels' test programs.
set -eu
usage() {
  echo "usage: $0 [--build DIR] [--reader] [--tests] [--limit MIB] OUTPUT.tar.xz|OUTPUT.tar.gz|FOLDER" >&2
  exit 2
}
fail() {
  echo "bundle: $*" >&2
  exit 1
}
root=$(cd "$(dirname "$0")/.." && pwd)
build=$root/build/release
limit=40
with_reader=no
with_tests=no
output=
while [ $# -gt 0 ]; do
  case $1 in
    --build) [ $# -gt 1 ] || usage; build=$2; shift ;;
    --limit) [ $# -gt 1 ] || usage; limit=$2; shift ;;
    --reader) with_reader=yes ;;
    --tests) with_tests=yes ;;
    -h | --help) sed -n '2,/^set -eu/{/^set -eu/d;s/^# \{0,1\}//;p;}' "$0"; exit 0 ;;
    -*) usage ;;
    *) [ -z "$output" ] || usage; output=$1 ;;
  esac
  shift
done
[ -n "$output" ] || usage
case $limit in '' | *[!0-9]*) usage ;; esac
[ ! -e "$output" ] || fail "$output is there already"
build=$(cd "$build" && pwd) || exit 1

program=$build/bin/vsplat
library=$build/model/api/libvsplat.so.1
look=$build/model/libexec/vsplat/vsplat-look
bench=$build/model/libexec/vsplat/vsplat-bench
reader=$build/model/libexec/vsplat/vsplat-read
rays=$build/model/libexec/vsplat/vsplat-rays.so
set -- "$program" "$library" "$look" "$bench" "$rays"
if [ $with_reader = yes ]; then set -- "$@" "$reader"; fi
if [ $with_tests = yes ]; then set -- "$@" "$build/tests/ops_tests" "$build/tests/runtime_tests"; fi
for file in "$@"; do
  [ -f "$file" ] || fail "$file is missing: build it first (cmake --build $build --target bin/vsplat ops_tests runtime_tests)"
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
top=$work/vsplat
mkdir -p "$top/bin" "$top/lib" "$top/libc" "$top/model/weights"

cp "$program" "$top/bin/vsplat.elf"
cp -L "$library" "$top/lib/libvsplat.so.1"
own="$top/bin/vsplat.elf;$top/lib/libvsplat.so.1"
# Programs are searched beside the library's folder, as in the build tree.
mkdir -p "$top/libexec/vsplat"
cp "$look" "$top/libexec/vsplat/vsplat-look.elf"
cp "$bench" "$top/libexec/vsplat/vsplat-bench.elf"
own="$own;$top/libexec/vsplat/vsplat-look.elf;$top/libexec/vsplat/vsplat-bench.elf"
cp "$rays" "$top/libexec/vsplat/vsplat-rays.so"
own="$own;$top/libexec/vsplat/vsplat-rays.so"
if [ $with_reader = yes ]; then
  cp "$reader" "$top/libexec/vsplat/vsplat-read.elf"
  own="$own;$top/libexec/vsplat/vsplat-read.elf"
fi
cp "$root/model/weights/train-on-a-gpu.sh" "$root/model/weights/gpu.json" "$top/model/weights/"
mkdir -p "$top/bench"
cp "$root/bench/gpu-driver.sh" "$root/bench/gpu-first-hour.sh" "$top/bench/"
if [ $with_tests = yes ]; then
  mkdir -p "$top/tests"
  for name in ops_tests runtime_tests; do
    cp "$build/tests/$name" "$top/tests/$name.elf"
    own="$own;$top/tests/$name.elf"
  done
fi

# ldd lists all libraries with their dependencies; missing ones are reported by name.
LD_LIBRARY_PATH=$(dirname "$library")${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} ldd "$@" >"$work/needed"
missing=$(awk '/not found/ { print $1 }' "$work/needed" | sort -u | tr '\n' ' ')
[ -z "$missing" ] || fail "libraries that are not found here: $missing"
awk '$2 == "=>" && $3 ~ /^\// { print $3 } $1 ~ /^\/.*\/ld-linux/ { print $1 }' "$work/needed" | sort -u >"$work/libraries"
while read -r file; do
  name=$(basename "$file")
  case $name in
    libvsplat.so*) ;;
    ld-linux* | libc.so* | libm.so* | libdl.so* | libpthread.so* | librt.so* | libresolv.so* | libutil.so* | libanl.so*)
      cp -L "$file" "$top/libc/$name" ;;
    *) cp -L "$file" "$top/lib/$name" ;;
  esac
done <"$work/libraries"
[ -f "$top/lib/libOpenCL.so.1" ] || fail "vsplat needs no libOpenCL.so.1: the OpenCL loader is missing in what was packed"
# Parts of the C library that a driver may need although nothing here does.
for name in libdl.so.2 libpthread.so.0 librt.so.1; do
  file=$(dirname "$(awk '$1 == "libc.so.6" { print $3; exit }' "$work/needed")")/$name
  if [ -f "$file" ]; then cp -L "$file" "$top/libc/$name"; fi
done
loader=$(cd "$top/libc" && ls ld-linux*) || fail "no ld-linux is among the libraries that ldd names"

# Removes symbols, and paths to folders of this machine.
cat >"$work/strip.cmake" <<'END'
foreach(file ${FILES})
  file(RPATH_REMOVE FILE "${file}")
endforeach()
END
chmod -R u+w "$top"
cmake "-DFILES=$own" -P "$work/strip.cmake" >/dev/null
find "$top" -type f \( -name '*.elf' -o -name '*.so' -o -path '*/lib/*' \) -exec strip --strip-unneeded {} +
wanted=$(find "$top" -type f \( -name '*.elf' -o -path '*/lib/*' \) -exec objdump -T {} + 2>/dev/null |
  grep -o 'GLIBC_2\.[0-9]*' | sort -t. -k2n | tail -n 1 | sed 's/GLIBC_//')
carried=$(objdump -T "$top/libc/libc.so.6" | grep -o 'GLIBC_2\.[0-9]*' | sort -t. -k2n | tail -n 1 | sed 's/GLIBC_//')

# launcher FILE UP PROGRAM: writes FILE, which starts PROGRAM of the bundle; UP is the path from FILE's folder to the bundle's.
launcher() {
  sed -e "s|@UP@|$2|g" -e "s|@PROGRAM@|$3|g" -e "s|@LOADER@|$loader|g" -e "s|@WANTED@|${wanted#2.}|g" >"$1" <<'END'
#!/bin/sh
# Starts @PROGRAM@ with the libraries of this folder. With this machine's C library (glibc) where that is 2.@WANTED@ or newer, else with the
# one that came along, which drivers that were built with older ones run with, too.
here=$(cd "$(dirname "$0")/@UP@" && pwd) || exit 1
LD_LIBRARY_PATH=$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
export LD_LIBRARY_PATH
version=$(getconf GNU_LIBC_VERSION 2>/dev/null) || version=
case $version in
  "glibc 2."*)
    minor=${version#glibc 2.}
    if [ "${minor%%[!0-9]*}" -ge @WANTED@ ]; then exec "$here/@PROGRAM@" "$@"; fi
    ;;
esac
exec "$here/libc/@LOADER@" --library-path "$here/libc:$LD_LIBRARY_PATH" "$here/@PROGRAM@" "$@"
END
  chmod 755 "$1"
}
launcher "$top/bin/vsplat" .. bin/vsplat.elf
if [ $with_tests = yes ]; then
  for name in ops_tests runtime_tests; do launcher "$top/tests/$name" .. "tests/$name.elf"; done
fi
for name in look bench; do launcher "$top/libexec/vsplat/vsplat-$name" ../.. "libexec/vsplat/vsplat-$name.elf"; done
if [ $with_reader = yes ]; then launcher "$top/libexec/vsplat/vsplat-read" ../.. libexec/vsplat/vsplat-read.elf; fi

echo "bundle: needs glibc $wanted, carries $carried; $(find "$top/lib" -type f | wc -l) libraries, $(du -sk "$top" | cut -f1) KiB unpacked" >&2
find "$top" -type f -size +1024k -exec du -k {} + | sort -rn | sed "s|$top/||; s/^/bundle:   KiB /" >&2

case $output in
  *.tar.xz) tar -C "$work" -cf - vsplat | xz -6 -T0 >"$work/archive" ;;
  *.tar.gz) tar -C "$work" -cf - vsplat | gzip -6 >"$work/archive" ;;
  *)
    mkdir -p "$(dirname "$output")"
    cp -r "$top" "$output"
    exit 0
    ;;
esac
size=$(wc -c <"$work/archive")
echo "bundle: $output: $((size / 1024)) KiB" >&2
[ "$size" -le $((limit * 1024 * 1024)) ] || fail "$output has $size bytes, more than the $limit MiB of --limit: not written"
mkdir -p "$(dirname "$output")"
cp "$work/archive" "$output"
