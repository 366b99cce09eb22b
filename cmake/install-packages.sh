#!/bin/sh
# Installs the Debian packages that building vsplat needs, on Debian 12 and 13. Does nothing if all are installed; uses sudo unless run as root.
#   cmake/install-packages.sh           what the build and the C++ tests need
#   cmake/install-packages.sh --tests   also what the other tests use: the PyTorch reference, other OpenCL devices, linters
#   cmake/install-packages.sh --list    only prints the names
# Packages for the other tests that this Debian release lacks are skipped, with a message that names the tests they leave out.
set -eu

build="build-essential cmake ninja-build git pkg-config
  ocl-icd-opencl-dev opencl-c-headers opencl-clhpp-headers pocl-opencl-icd libclblast-dev
  libeigen3-dev libfmt-dev nlohmann-json3-dev libcli11-dev
  libpng-dev libjpeg62-turbo-dev libopenexr-dev libwebp-dev libgif-dev libtiff-dev libexif-dev libstb-dev libzip-dev libzstd-dev libutf8proc-dev zlib1g-dev libssl-dev libmicrohttpd-dev
  libassimp-dev libdraco-dev libmeshoptimizer-dev libembree-dev libhdf5-dev libnanoflann-dev
  libgtest-dev python3"
tests="python3-torch python3-numpy python3-scipy python3-pil libopenblas-dev libdnnl-dev libopenmpi-dev openmpi-bin
  libsdl2-dev xvfb xauth mesa-opencl-icd oclgrind clang-15 libclc-15 clang-format clang-tidy clang libclang-rt-dev strace
  debootstrap file"

with_tests=no
list=no
for argument in "$@"; do
  case $argument in
    --tests) with_tests=yes ;;
    --list) list=yes ;;
    *) echo "usage: $0 [--tests] [--list]" >&2; exit 2 ;;
  esac
done
[ $with_tests = yes ] || tests=
if [ "$list" = yes ]; then
  printf '%s\n' $build $tests
  exit 0
fi

# Prints the named packages that are not installed.
missing_of() {
  for package in "$@"; do
    state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) || state=
    [ "$state" = installed ] || echo "$package"
  done
}
# Whether apt's lists contain the package.
is_known() { apt-cache policy "$1" 2>/dev/null | grep '^ *Candidate:' | grep -qv '(none)'; }
# The tests that are left out without a package that this release lacks.
left_out_without() {
  case $1 in
    oclgrind) echo "the tests oclgrind.*, which look for data races in kernels" ;;
    clang-15 | libclc-15) echo "the tests gpu_static*, whose table was made with version 15" ;;
    *) echo "the tests that use it" ;;
  esac
}

missing=$(missing_of $build $tests)
[ -n "$missing" ] || exit 0
sudo=
if [ "$(id -u)" -ne 0 ] && command -v sudo >/dev/null; then sudo=sudo; fi
as_root() {
  if [ "$(id -u)" -ne 0 ] && [ -z "$sudo" ]; then
    echo "run this as root, or install sudo: it installs" $missing >&2
    exit 1
  fi
  $sudo "$@"
}
# If an up-to-date list contains none of the missing packages, there is nothing to do.
wanted=
if is_known build-essential; then
  for package in $missing; do
    if is_known "$package"; then wanted="$wanted $package"; fi
  done
fi
if [ -n "$wanted" ] || ! is_known build-essential || [ -n "$(missing_of $build)" ]; then
  as_root apt-get update -q
fi
wanted=
for package in $missing; do
  case " $(echo $tests) " in
    *" $package "*)
      if ! is_known "$package"; then
        echo "this release of Debian has no $package: left out are $(left_out_without "$package")" >&2
        continue
      fi
      ;;
  esac
  wanted="$wanted $package"
done
[ -n "$wanted" ] || exit 0
echo "installing:$wanted" >&2
# shellcheck disable=SC2086  # a list of words
as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $wanted
