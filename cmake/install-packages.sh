#!/bin/sh
# Installs the packages that building vsplat needs, on Debian 12 (bookworm), 13 (trixie) and testing (forky), and on Ubuntu 24.04 (noble). Does
# nothing if all are installed; uses sudo unless run as root. On another system, it prints what is needed and succeeds: cmake then says what
# is missing.
#   cmake/install-packages.sh           what the build and the C++ tests need
#   cmake/install-packages.sh --tests   also what the other tests use: the PyTorch reference, other OpenCL devices, linters
#   cmake/install-packages.sh --list    only prints the names
# What a release lacks is skipped, with a message that names the tests that are left out. $VSPLAT_OS_RELEASE replaces /etc/os-release.
set -eu

# A|B: the first of these that is installed, or else that the release has.
build="build-essential cmake ninja-build git pkg-config
  ocl-icd-opencl-dev opencl-c-headers opencl-clhpp-headers pocl-opencl-icd libclblast-dev
  libeigen3-dev libfmt-dev nlohmann-json3-dev libcli11-dev
  libpng-dev libjpeg62-turbo-dev|libjpeg-dev libopenexr-dev libwebp-dev libgif-dev libtiff-dev libexif-dev libstb-dev libzip-dev libzstd-dev
  libutf8proc-dev zlib1g-dev libssl-dev libmicrohttpd-dev
  libassimp-dev libdraco-dev libmeshoptimizer-dev libembree-dev libhdf5-dev libnanoflann-dev
  libgtest-dev python3"
tests="python3-torch python3-numpy python3-scipy python3-pil libopenblas-dev libdnnl-dev libopenmpi-dev openmpi-bin
  libsdl2-dev xvfb xauth mesa-opencl-icd oclgrind clang-15 libclc-15 clang-format clang-tidy clang libclang-rt-dev strace
  debootstrap file patchelf"

# The tests that are left out without a package.
left_out_without() {
  case $1 in
    python3-*) echo "the comparisons with PyTorch, and the tests of the Python module" ;;
    libopenblas-dev | libdnnl-dev) echo "the libraries that vsplat bench compares with" ;;
    libopenmpi-dev | openmpi-bin) echo "the tests cli_ranks of several processes" ;;
    libsdl2-dev | xvfb | xauth) echo "the test window_example" ;;
    mesa-opencl-icd) echo "the tests rusticl.*" ;;
    oclgrind) echo "the tests oclgrind.*, which look for data races in kernels" ;;
    clang-15 | libclc-15) echo "the tests gpu_static*, whose table was made with version 15" ;;
    clang-format | clang-tidy) echo ".ci/check-format and .ci/lint" ;;
    clang | libclang-rt-dev) echo "the fuzzers" ;;
    strace) echo "the test cli_hostile_traced" ;;
    debootstrap | file) echo "the tests install_packages and systems_*" ;;
    *) echo "everything: the build needs it" ;;
  esac
}

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

is_installed() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }
# Whether apt's lists contain the package.
is_known() { apt-cache policy "$1" 2>/dev/null | grep '^ *Candidate:' | grep -qv '(none)'; }
# missing_of A|B...: prints what is not installed, by the name that apt knows; with an exclamation mark if it knows none.
missing_of() {
  for names in "$@"; do
    found=
    for package in $(echo "$names" | tr '|' ' '); do
      if is_installed "$package"; then continue 2; fi
      if [ -z "$found" ] && is_known "$package"; then found=$package; fi
    done
    echo "${found:-${names%%|*}!}"
  done
}

if [ $list = yes ]; then
  # shellcheck disable=SC2086  # a list of words
  printf '%s\n' $build $tests | sed 's/|.*//'
  exit 0
fi

# shellcheck source=/dev/null
system=$(. "${VSPLAT_OS_RELEASE:-/etc/os-release}" 2>/dev/null && echo "${ID-} ${VERSION_CODENAME-} ${PRETTY_NAME-}") || system=
case $system in
  "debian bookworm "* | "debian trixie "* | "debian forky "* | "debian sid "* | "ubuntu noble "*) is_ours=yes ;;
  *) is_ours=no ;;
esac
if [ $is_ours = no ] || ! command -v apt-get >/dev/null; then
  system=${system#* * }
  echo "Packages are installed on Debian 12 to 14 and on Ubuntu 24.04 only; this is ${system:-an unknown system}. Debian calls what is needed:"
  # shellcheck disable=SC2086
  echo $build $tests | sed 's/|/ or /g' | fold -s -w 110 | sed 's/^/  /; s/ $//'
  exit 0
fi >&2

# shellcheck disable=SC2086
missing=$(missing_of $build $tests)
[ -n "$missing" ] || exit 0
sudo=
if [ "$(id -u)" -ne 0 ] && command -v sudo >/dev/null; then sudo=sudo; fi
as_root() {
  if [ "$(id -u)" -ne 0 ] && [ -z "$sudo" ]; then
    echo "run this as root, or install sudo: it installs $(echo "$missing" | tr '\n' ' ')" >&2
    exit 1
  fi
  $sudo "$@"
}
# Up-to-date lists that have none of the missing packages need no update.
if ! is_known build-essential || echo "$missing" | grep -qv '!$'; then
  as_root apt-get update -q
  # shellcheck disable=SC2086
  missing=$(missing_of $build $tests)
fi
wanted=
for package in $missing; do
  case $package in
    *!) echo "this release has no ${package%!}: this leaves out $(left_out_without "${package%!}")" >&2 ;;
    *) wanted="$wanted $package" ;;
  esac
done
# Some releases have packages that exclude each other: Ubuntu 24.04's libclc-15 and the one that Mesa needs.
can_install() { apt-get install -s -q --no-install-recommends "$@" >/dev/null 2>&1; }
# shellcheck disable=SC2086
if [ -n "$wanted" ] && ! can_install $wanted && can_install build-essential; then  # else apt itself says what is wrong
  all=$wanted wanted=
  for package in $all; do
    if can_install $wanted "$package"; then
      wanted="$wanted $package"
    else
      echo "this release has no $package that fits the other packages: this leaves out $(left_out_without "$package")" >&2
    fi
  done
fi
[ -n "$wanted" ] || exit 0
echo "installing:$wanted" >&2
# shellcheck disable=SC2086
as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $wanted
