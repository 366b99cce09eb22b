#!/bin/sh
# Cross-compiles everything for 64-bit ARM, and runs tests of it in an arm64 system made by debootstrap, by qemu-user: those that need no
# device, and some on PoCL.
#   tests/systems/arm64.sh [--work DIR]
#     --work DIR  for the system, its downloads, sources, build and log (default: $TMPDIR/vsplat-systems); takes some 6 GiB
# It clones what is committed. Exits with 77 without root, debootstrap, cross compilers, qemu-user with its binary format registered,
# permission to mount, or the network.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
sources=$(cd "$here/../.." && pwd)
test=arm64
. "$here/bare.sh"

usage() {
  sed -n '2,/^set /{/^set /d; s/^# \{0,1\}//; p}' "$0" >&2
  exit 2
}
work=${TMPDIR:-/tmp}/vsplat-systems
case ${1-} in
  --work) [ $# = 2 ] || usage; work=$2 ;;
  '') ;;
  *) usage ;;
esac

needs aarch64-linux-gnu-g++ cmake ninja
[ -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ] || skip "programs for arm64 are not run here: install qemu-user-static and binfmt-support"
reaches "$debian" bookworm
folder=$work
alone "$0" "$@"
work=$folder

mkdir -p "$work/arm64-downloads/partial"
work=$(cd "$work" && pwd)
root=$work/arm64 tree=$work/tree-arm64 log=$work/arm64.log  # (CMake takes what begins with the root for a part of it)
exec 9>"$work/arm64.lock"
flock -n 9 || fail "another run uses $root"
: >"$log"
logged() { "$@" >>"$log" 2>&1 </dev/null || { tail -n 30 "$log" >&2; fail "$1 failed: see $log"; }; }

# Debian's files name libraries by their places in the system, which is not the root here.
root_paths() {
  find "$root/usr/lib" "$root/etc/alternatives" -lname '/*' | while read -r link; do
    ln -snf "$(realpath -sm --relative-to="$(dirname "$link")" "$root$(readlink "$link")")" "$link"
  done
  find "$root/usr/lib" -name '*.cmake' -exec sed -i "s#\([^a-z0-9]\)/usr/\(lib\|include\)#\1$root/usr/\2#g" {} +
}
if [ ! -e "$root/usr/include/gtest" ]; then
  rm -rf --one-file-system "$root"
  make_system bookworm "$root" "$debian" --arch=arm64 --include=ca-certificates
  mount_system "$root"
  mount --bind "$work/arm64-downloads" "$root/var/cache/apt/archives"
  packages=$("$sources/cmake/install-packages.sh" --list | grep -vx -e build-essential -e cmake -e ninja-build -e git -e pkg-config | tr '\n' ' ')
  # shellcheck disable=SC2086
  logged within "$root" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends libc6-dev libstdc++-12-dev $packages
  root_paths
else
  mount_system "$root"
fi
rm -rf "$tree"
git -c safe.directory='*' clone -q --no-hardlinks "file://$sources" "$tree"
export VSPLAT_SYSROOT="$root" QEMU_LD_PREFIX="$root"
began=$(date +%s)
build=$tree/build/release
(cd "$tree" && logged cmake --preset release --toolchain cmake/aarch64-linux-gnu.cmake -DVSPLAT_TESTS=ON -DVSPLAT_QUICK_BUILD=ON)
logged cmake --build "$build"
echo "built for arm64 in $(($(date +%s) - began)) s"
grep 'warning: .*\[-W' "$log" | sort -u | sed 's/^/  /' || true
mkdir -p "$root$tree"
mount --bind "$tree" "$root$tree"

# tests PROGRAM [FILTER]
code=0
tests() {
  ran=$(within "$root" "$build/tests/$1" --gtest_brief=1 --gtest_filter="${2-*}" 2>&1 </dev/null) || code=1
  echo "$ran" >>"$log"
  echo "$1: $(echo "$ran" | sed -n 's/^\[ *\(PASSED\|FAILED\) *\] \([0-9]* test.*\)/\1 \2/p' | tr '\n' ' ')"
}
tests base_tests
tests cameras_tests
tests io_tests
tests params_tests
tests pictures_tests
tests ops_tests '*Adamw*/*:*Sort*/*:*Decode*/*:*Rasterize*/cpu'
within "$root" "$build/bin/vsplat" reconstruct "$tree/examples/data/garden_gnome" --output /tmp/gnome.ply --overwrite >>"$log" 2>&1 || code=1
tail -n 1 "$log"
echo "all in $(($(date +%s) - began)) s"
exit $code
