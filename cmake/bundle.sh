#!/bin/sh
# Packs a built vsplat so that it runs from any folder of any x86-64 Linux with glibc 2.31 or newer: what `cmake --install` installs (the
# command, the C library with its headers, the Python module), every shared library that they need, including the OpenCL loader, the
# scripts for the first runs on a GPU (bench/gpu-first-hour.sh) and for training there (model/weights/train-on-a-gpu.sh), and PoCL, an
# OpenCL driver for processors. PoCL is used only on a machine that has no OpenCL driver of its own, and a line on stderr says so. The C and
# C++ libraries are packed, too, but used only if the machine's are older than these.
#   cmake/bundle.sh [--build DIR] [--no-driver] [--data] [--tests] [--limit MB] OUTPUT
# OUTPUT is NAME.tar.xz, NAME.tar.gz (larger, but a bare machine may lack xz), or a folder that does not exist yet. DIR is the build, by
# default build/release. An archive of more than MB million bytes is an error (.tar.xz: 60 by default). --no-driver leaves PoCL out.
# --data adds what draws training data and reads meshes and HDF5 files, with the libraries for it, as the Debian package libvsplat1-data
# does. --tests adds the kernels' test programs. cmake/wheel.py makes a Python wheel of a folder that this has written.
set -eu
usage() {
  echo "usage: $0 [--build DIR] [--no-driver] [--data] [--tests] [--limit MB] OUTPUT.tar.xz|OUTPUT.tar.gz|FOLDER" >&2
  exit 2
}
fail() {
  echo "bundle: $*" >&2
  exit 1
}
root=$(cd "$(dirname "$0")/.." && pwd)
build=$root/build/release
limit=
with_driver=yes
with_data=no
with_tests=no
output=
while [ $# -gt 0 ]; do
  case $1 in
    --build) [ $# -gt 1 ] || usage; build=$2; shift ;;
    --limit) [ $# -gt 1 ] || usage; limit=$2; shift ;;
    --no-driver) with_driver=no ;;
    --data) with_data=yes ;;
    --tests) with_tests=yes ;;
    -h | --help) sed -n '2,/^set -eu/{/^set -eu/d;s/^# \{0,1\}//;p;}' "$0"; exit 0 ;;
    -*) usage ;;
    *) [ -z "$output" ] || usage; output=$1 ;;
  esac
  shift
done
[ -n "$output" ] || usage
case $output:$limit in *.tar.xz:) limit=60 ;; esac
case $limit in *[!0-9]*) usage ;; esac
[ ! -e "$output" ] || fail "$output is there already"
build=$(cd "$build" && pwd) || exit 1
command -v patchelf >/dev/null || fail "patchelf is missing: install it (Debian: the package patchelf)"
libdir=$(sed -n 's/^CMAKE_INSTALL_LIBDIR:[A-Z]*=//p' "$build/CMakeCache.txt")

set -- bin/vsplat model/libexec/vsplat/vsplat-look model/libexec/vsplat/vsplat-bench
if [ $with_data = yes ]; then set -- "$@" model/libexec/vsplat/vsplat-read model/libexec/vsplat/vsplat-rays.so; fi
if [ $with_tests = yes ]; then set -- "$@" tests/ops_tests tests/runtime_tests; fi
for file in "$@"; do
  [ -f "$build/$file" ] || fail "$build/$file is missing: build it first (cmake --build $build --target all ops_tests runtime_tests)"
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
top=$work/vsplat
cmake --install "$build" --prefix "$top" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
# The window needs the machine's libraries of its display; MPI and what benchmarks compare with, those of who uses them.
rm -rf "$top/bin/vsplat-window" "$top/$libdir"/libvsplat.a "$top/$libdir"/cmake/vsplat/vsplatStatic*
for file in "$top/libexec/vsplat"/*; do
  case ${file##*/} in
    vsplat-look | vsplat-bench) ;;
    vsplat-read | vsplat-rays.so) [ $with_data = yes ] || rm "$file" ;;
    *) rm "$file" ;;
  esac
done
mkdir -p "$top/libc" "$top/libcxx" "$top/model/weights" "$top/bench"
cp "$root/model/weights/train-on-a-gpu.sh" "$root/model/weights/gpu.json" "$top/model/weights/"
cp "$root/bench/gpu-driver.sh" "$root/bench/gpu-first-hour.sh" "$top/bench/"
if [ $with_tests = yes ]; then
  mkdir -p "$top/tests"
  cp "$build/tests/ops_tests" "$build/tests/runtime_tests" "$top/tests/"
fi

# Programs are named NAME.elf; NAME is the script that starts them.
set --
for file in "$top/bin/vsplat" "$top/libexec/vsplat"/* "$top/tests"/*; do
  case $file in
    *'*') ;;
    *.so) set -- "$@" "$file" ;;
    *) mv "$file" "$file.elf"; set -- "$@" "$file.elf" ;;
  esac
done
chmod -R u+w "$top"

# take FOLDER FILE...: copies the libraries that the files need, all of them, to FOLDER unless they are packed already. ldd reports those
# that are missing by name.
take() {
  folder=$1
  shift
  mkdir -p "$folder"
  LD_LIBRARY_PATH=$work/instead:$folder/pocl:$top/$libdir${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} ldd "$@" >"$work/needed"
  missing=$(awk '/not found/ { print $1 }' "$work/needed" | sort -u | tr '\n' ' ')
  [ -z "$missing" ] || fail "libraries that are not found here: $missing"
  awk '$2 == "=>" && $3 ~ /^\// { print $3 } $1 ~ /^\/.*\/ld-linux/ { print $1 }' "$work/needed" | sort -u >"$work/libraries"
  while read -r file; do
    name=${file##*/}
    case $name in
      ld-linux* | libc.so* | libm.so* | libmvec.so* | libdl.so* | libpthread.so* | librt.so* | libresolv.so* | libutil.so* | libanl.so*) to=$top/libc ;;
      libstdc++.so* | libgcc_s.so*) to=$top/libcxx ;;
      *) to=$folder ;;
    esac
    if [ -e "$to/$name" ] || [ -e "$top/$libdir/$name" ] || [ "${file#"$top/"}" != "$file" ]; then continue; fi
    cp -L "$file" "$to/$name"
    case $file in "$work"/*) ;; *) echo "$file" >>"$work/taken" ;; esac
  done <"$work/libraries"
}
take "$top/$libdir" "$top/$libdir/libvsplat.so.1" "$@"
[ -f "$top/$libdir/libOpenCL.so.1" ] || fail "vsplat needs no libOpenCL.so.1: the OpenCL loader is missing in what was packed"
# Parts of the C library that a driver may need although nothing here does.
system=$(dirname "$(awk '$1 == "libc.so.6" { print $3; exit }' "$work/needed")")
for name in libdl.so.2 libpthread.so.0 librt.so.1 libmvec.so.1; do
  if [ -f "$system/$name" ]; then cp -L "$system/$name" "$top/libc/$name"; fi
done
loader=$(cd "$top/libc" && ls ld-linux*) || fail "no ld-linux is among the libraries that ldd names"

# without LIBRARY FILE...: makes a stand-in for a library that the files need but whose functions are never called here: each ends the program.
without() {
  real=$(ldconfig -p | awk -v name="$1" '$1 == name { print $NF; exit }')
  [ -n "$real" ] || return 0
  name=$1
  shift
  nm -D --with-symbol-versions --undefined-only "$@" | awk 'NF == 2 { print $2 }' | sort -u >"$work/wanted"
  nm -D --with-symbol-versions --defined-only "$real" | sed 's/@@/@/' | awk 'NR == FNR { is_wanted[$1] = 1; next } $3 in is_wanted { print $2, $3 }' "$work/wanted" - >"$work/symbols"
  mkdir -p "$work/instead"
  sed 's/@/ /' "$work/symbols" | awk '
    BEGIN { print "void abort(void);" }
    $1 ~ /[DBV]/ { print "void* " $2 ";"; next }
    { print "void " $2 "(void) { abort(); }" }' >"$work/instead.c"
  sed -n 's/^. \(.*\)@\(.*\)/\2 \1/p' "$work/symbols" | sort | awk '
    $1 != last { if (last) print "};"; print $1 " { global:"; last = $1 }
    { print "  " $2 ";" }
    END { if (last) print "};" }' >"$work/instead.map"
  set -- -shared -fPIC -w -fno-builtin "-Wl,-soname,$name" -o "$work/instead/$name"
  if [ -s "$work/instead.map" ]; then set -- "$@" "-Wl,--version-script,$work/instead.map"; fi
  cc "$@" "$work/instead.c"
}

if [ $with_driver = yes ]; then
  pocl=$(ldconfig -p | awk '$1 ~ /^libpocl\.so\./ { print $NF; exit }')
  [ -n "$pocl" ] || fail "PoCL is not installed here (Debian: pocl-opencl-icd); --no-driver packs without it"
  pocl=$(dirname "$pocl")/$(basename "$pocl")
  share=$(cd "$(dirname "$(readlink -f "$pocl")")/../../share/pocl" && pwd) || fail "$pocl has no ../../share/pocl: --no-driver packs without it"
  # PoCL finds its files from where its library lies.
  there=$top/pocl/lib/$(uname -m)
  mkdir -p "$there/pocl" "$top/pocl/bin" "$top/pocl/share" "$top/pocl/link"
  cp -rL "$share" "$top/pocl/share/pocl"
  cp -L "$pocl" "$there/"
  cp -L "$(dirname "$(readlink -f "$pocl")")/pocl"/*.so "$there/pocl/"
  cp -L "$(command -v ld)" "$top/pocl/bin/ld.elf"
  chmod -R u+w "$top/pocl"
  printf '%s\n' "$pocl" "$(command -v ld)" >>"$work/taken"
  # LLVM's libraries name the solver Z3, which only clang's analyser uses, and libxml2, which only linking for Windows does. With ICU,
  # which libxml2 needs, they are a quarter of PoCL's size.
  ldd "$there"/libpocl.so.* | awk '$1 ~ /^lib(LLVM|clang)/ { print $3 }' >"$work/llvm"
  # shellcheck disable=SC2046  # a list of files
  for name in $(ldd "$there"/libpocl.so.* | awk '$1 ~ /^lib(z3|xml2)\./ { print $1 }'); do without "$name" $(cat "$work/llvm"); done
  take "$there" "$there"/libpocl.so.* "$there/pocl"/*.so "$top/pocl/bin/ld.elf"
  # PoCL links each kernel with these by -l, as a compiler does. The machine may have no compiler, nor these files.
  for name in m:libm.so.6 c:libc.so.6 gcc:libgcc_s.so.1 gcc_s:libgcc_s.so.1; do
    echo "INPUT ( ${name#*:} )" >"$top/pocl/link/lib${name%%:*}.so"
  done
  bundled=pocl/lib/$(uname -m)/$(basename "$pocl")
  cat >"$top/pocl/environment" <<END
# Sets what PoCL of this folder needs, and chooses it if this machine has no OpenCL driver. The scripts that start vsplat's programs read
# this; so may whoever starts a program of his own: here=FOLDER; . FOLDER/pocl/environment, FOLDER being the absolute path to what was unpacked.
if [ -z "\${OCL_ICD_VENDORS-}\${OCL_ICD_FILENAMES-}" ]; then
  has_driver=no
  for entry in /etc/OpenCL/vendors/*.icd; do
    if [ -e "\$entry" ]; then has_driver=yes; fi
  done
  if [ \$has_driver = no ]; then
    OCL_ICD_VENDORS=\$here/$bundled
    export OCL_ICD_VENDORS
    echo "vsplat: this machine has no OpenCL driver (nothing in /etc/OpenCL/vendors): uses PoCL, which came along, on the processor" >&2
  fi
fi
if [ "\${OCL_ICD_VENDORS-}" = "\$here/$bundled" ]; then
  # PoCL links kernels: with this machine's linker if it has one.
  PATH=\$PATH:\$here/pocl/bin
  LIBRARY_PATH=\${LIBRARY_PATH:+\$LIBRARY_PATH:}\$here/pocl/link:\$here/libc:\$here/libcxx
  export PATH LIBRARY_PATH
fi
END
fi

# Removes symbols; libraries are found from where a file lies, which no path to a folder of this machine may replace.
find "$top" -type f \( -name '*.elf' -o -name '*.so' -o -name '*.so.*' \) >"$work/all"
while read -r file; do
  if ! objdump -f "$file" >/dev/null 2>&1; then continue; fi
  echo "$file"
done <"$work/all" >"$work/elves"
while read -r file; do
  case $file in "$top/libc/"*) continue ;; esac
  strip --strip-unneeded "$file"
  path="\$ORIGIN/$(realpath --relative-to="$(dirname "$file")" "$top/$libdir")"
  case $file in
    "$top/$libdir/"*) path="\$ORIGIN" ;;
    "$top/pocl/"*) path="\$ORIGIN:\$ORIGIN/$(realpath --relative-to="$(dirname "$file")" "$there"):$path" ;;
  esac
  patchelf --set-rpath "$path" "$file"
done <"$work/elves"
# newest NAME: the newest version NAME_... of symbols that what was packed needs, but for the C and C++ libraries themselves.
newest() {
  grep -v "^$top/libc" "$work/elves" | xargs objdump -T 2>/dev/null | grep '\*UND\*' | grep -o "$1_[0-9][0-9.]*" | sed "s/$1_//" | sort -u -V | tail -n 1
}
wanted=$(newest GLIBC)
wanted_cxx=$(newest GLIBCXX)
carried=$(objdump -T "$top/libc/libc.so.6" | grep -o 'GLIBC_2\.[0-9]*' | sort -u -V | tail -n 1 | sed 's/GLIBC_//')

# launcher FILE UP: writes FILE, which starts FILE.elf of the bundle; UP is the path from FILE's folder to the bundle's.
launcher() {
  program=${1#"$top/"}.elf
  sed -e "s|@UP@|$2|g" -e "s|@PROGRAM@|$program|g" -e "s|@LOADER@|$loader|g" -e "s|@WANTED@|${wanted#2.}|g" -e "s|@CXX@|$wanted_cxx|g" \
    >"$1" <<'END'
#!/bin/sh
# Starts @PROGRAM@ with the libraries of this folder. With this machine's C library (glibc) if that is 2.@WANTED@ or newer, else with the
# one that came along, which drivers that were built with older ones run with, too. It is the same with the C++ library.
here=$(cd "$(dirname "$(readlink -f "$0")")/@UP@" && pwd -P) || exit 1
case ${1-} in
  '' | -h | --help | --version | help | completion) ;;
  *) if [ -f "$here/pocl/environment" ]; then . "$here/pocl/environment"; fi ;;
esac
has_cxx=no
for folder in /lib/x86_64-linux-gnu /usr/lib/x86_64-linux-gnu /lib64 /usr/lib64 /lib /usr/lib; do
  if grep -qs 'GLIBCXX_@CXX@' "$folder/libstdc++.so.6"; then
    has_cxx=yes
    break
  fi
done
version=$(getconf GNU_LIBC_VERSION 2>/dev/null) || version=
case $version in
  "glibc 2."*)
    minor=${version#glibc 2.}
    if [ "${minor%%[!0-9]*}" -ge @WANTED@ ]; then
      if [ $has_cxx = no ]; then
        LD_LIBRARY_PATH=$here/libcxx${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
        export LD_LIBRARY_PATH
      fi
      exec "$here/@PROGRAM@" "$@"
    fi
    ;;
esac
exec "$here/libc/@LOADER@" --library-path "$here/libc:$here/libcxx${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" "$here/@PROGRAM@" "$@"
END
  chmod 755 "$1"
}
find "$top" -name '*.elf' >"$work/programs"
while read -r file; do
  chmod 755 "$file"
  file=${file%.elf}
  launcher "$file" "$(realpath --relative-to="$(dirname "$file")" "$top")"
done <"$work/programs"

# What others wrote: their packages, with versions, by which the sources are found, and their licences.
if command -v dpkg-query >/dev/null && [ -s "$work/taken" ]; then
  licences=$top/share/doc/vsplat/libraries
  mkdir -p "$licences"
  sort -u "$work/taken" | while read -r file; do
    dpkg-query -S "$file" 2>/dev/null || dpkg-query -S "$(readlink -f "$file")" 2>/dev/null || dpkg-query -S "/usr$file" 2>/dev/null ||
      dpkg-query -S "/usr$(readlink -f "$file")" 2>/dev/null || echo "$file is of no package" >&2
  done | sed 's/: .*//' | sort -u >"$work/owners"
  if [ $with_driver = yes ]; then dpkg-query -S "$share" 2>/dev/null | sed 's/: .*//' | tr ',' '\n' | tr -d ' ' >>"$work/owners"; fi
  sort -u "$work/owners" | while read -r package; do
    dpkg-query -W -f '${source:Package} ${source:Version} ${binary:Package}\n' "$package"
    if [ -f "/usr/share/doc/${package%%:*}/copyright" ]; then cp -L "/usr/share/doc/${package%%:*}/copyright" "$licences/${package%%:*}.copyright"; fi
  done >"$licences/packages.txt"
fi

echo "bundle: needs glibc $wanted, carries $carried; $(grep -c '\.so' "$work/elves") libraries, $(du -sk "$top" | cut -f1) KiB unpacked" >&2
find "$top" -type f -size +1024k -exec du -k {} + | sort -rn | sed "s|$top/||; s/^/bundle:   KiB /" >&2

# Files that contain the built-in model are neighbours, so that it is compressed once.
pack() {
  (cd "$work" && find vsplat ! -type d | LC_ALL=C sort >all
    grep '/libvsplat\.so\|\.elf$' all >first
    grep -v '/libvsplat\.so\|\.elf$' all >rest
    cat first rest | tar --owner=0 --group=0 --numeric-owner -cf - -T -)
}
case $output in
  *.tar.xz) pack | xz --x86 --lzma2=preset=9e -T1 >"$work/archive" ;;
  *.tar.gz) pack | gzip -9 >"$work/archive" ;;
  *)
    mkdir -p "$(dirname "$output")"
    cp -r "$top" "$output"
    exit 0
    ;;
esac
size=$(wc -c <"$work/archive")
echo "bundle: $output: $size bytes" >&2
[ -z "$limit" ] || [ "$size" -le $((limit * 1000000)) ] || fail "$output has $size bytes, more than the $limit million of --limit: not written"
mkdir -p "$(dirname "$output")"
cp "$work/archive" "$output"
