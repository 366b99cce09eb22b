#!/bin/sh
# Unpacks Debian's packages of the AMD and Intel driver compilers that static_check.py needs and this system lacks into a folder, without
# installing them. Intel's compiler must not be installed where tests run: its package is also an OpenCL driver, which appears among the
# devices, and loading it ends every program that is built with sanitizers.
#   tests/gpu/fetch_compilers.sh DIR
# Does nothing if all compilers are there; exits with 77 if they are not available.
set -eu
[ $# -eq 1 ] || { echo "usage: $0 DIR" >&2; exit 2; }
folder=$1
ocloc=$folder/usr/bin/ocloc
libraries=$folder/usr/lib/x86_64-linux-gnu
try=$(mktemp -d)
trap 'rm -rf "$try"' EXIT
echo 'kernel void try(global float* x) { *x = 1; }' >"$try/try.cl"
works() {
  [ -x "$ocloc" ] && [ -x "$folder/usr/bin/iga64" ] && [ -d "$libraries/amdgcn/bitcode" ] &&
    LD_LIBRARY_PATH=$libraries "$ocloc" compile -file "$try/try.cl" -device dg2 -out_dir "$try" >"$try/log" 2>&1 &&
    [ -n "$(find "$try" -name '*.bin')" ]
}
if works; then exit 0; fi
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || { echo "$0: Debian's apt-get and dpkg-deb are needed" >&2; exit 77; }

# The packages to unpack: the compilers, and their dependencies that are not installed.
wanted="rocm-device-libs libigc-tools intel-opencl-icd"
needed=$(apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces --no-enhances intel-opencl-icd |
  sed -n 's/^\([a-z0-9][a-z0-9.+-]*\)$/\1/p' | sort -u)
for package in $needed; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) || state=
  case " $wanted " in *" $package "*) continue ;; esac
  [ "$state" = installed ] || wanted="$wanted $package"
done

mkdir -p "$folder/packages"
folder=$(cd "$folder" && pwd)
cd "$folder/packages"
# shellcheck disable=SC2086  # a list of words
apt-get download $wanted >log 2>&1 || { cat log >&2; echo "$0: cannot download:$wanted (apt-get update?)" >&2; exit 77; }
for package in *.deb; do dpkg-deb -x "$package" "$folder"; done
cd "$folder"
rm -rf packages etc  # etc would list a driver
ocloc=$folder/usr/bin/ocloc
libraries=$folder/usr/lib/x86_64-linux-gnu
works || { cat "$try/log" >&2; echo "$0: Intel's ocloc does not run from $folder" >&2; exit 1; }
