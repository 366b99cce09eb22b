#!/bin/sh
# Installs the Debian packages that vsplat is built with. Does nothing where all are there; asks sudo where not root.
#   cmake/install-packages.sh           what the build and the tests in C++ need
#   cmake/install-packages.sh --tests   also what the other tests use: the PyTorch reference, other OpenCL devices, linters
#   cmake/install-packages.sh --list    only prints the names
set -eu

build="build-essential cmake ninja-build git pkg-config
  ocl-icd-opencl-dev opencl-c-headers opencl-clhpp-headers pocl-opencl-icd libclblast-dev
  libeigen3-dev libfmt-dev nlohmann-json3-dev libcli11-dev
  libpng-dev libjpeg62-turbo-dev libopenexr-dev libwebp-dev libtiff-dev libexif-dev libstb-dev libzip-dev libssl-dev
  libassimp-dev libembree-dev libhdf5-dev libnanoflann-dev
  libgtest-dev python3"
tests="python3-torch python3-numpy python3-scipy python3-pil libopenblas-dev libdnnl-dev libopenmpi-dev openmpi-bin
  libsdl2-dev xvfb xauth mesa-opencl-icd oclgrind clang-15 libclc-15 clang-format clang-tidy clang libclang-rt-dev strace
  debootstrap file"

packages=$build
list=no
for argument in "$@"; do
  case $argument in
    --tests) packages="$packages $tests" ;;
    --list) list=yes ;;
    *) echo "usage: $0 [--tests] [--list]" >&2; exit 2 ;;
  esac
done
if [ "$list" = yes ]; then
  printf '%s\n' $packages
  exit 0
fi

missing=
for package in $packages; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) || state=
  [ "$state" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

echo "installing:$missing" >&2
sudo=
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "run this as root: it installs$missing" >&2; exit 1; }
  sudo=sudo
fi
$sudo apt-get update -q
# shellcheck disable=SC2086  # a list of words
$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $missing
