#!/bin/sh
# Makes the archive of cmake/bundle.sh and the wheel of cmake/wheel.py, and tries both in bare systems made by debootstrap, without a
# network, a compiler or a driver: the command and the Python module give the same bytes as the build here does with the same driver.
#   tests/install/bundle.sh BUILD_DIR
# Downloads some 100 MiB a system. Exits with 77 without debootstrap, without permission to mount and chroot, without PoCL to pack, or if
# Debian's packages cannot be reached. $VSPLAT_BARE_SYSTEMS names the systems: a suite, or
# SUITE=MIRROR for another distribution's. To try again without the minutes of compressing and downloading: $VSPLAT_BUNDLE_MADE is an
# archive, $VSPLAT_BARE_FOLDER holds systems made by debootstrap, in folders named like suites.
set -eu
build=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
tree=$(cd "$here/../.." && pwd)
systems=${VSPLAT_BARE_SYSTEMS:-bookworm trixie}
test="bundle test"
. "$here/../systems/bare.sh"
if grep -q '^VSPLAT_SANITIZE:BOOL=ON' "$build/CMakeCache.txt"; then skip "a build with sanitizers is not packed"; fi
needs patchelf
unshare --net true 2>/dev/null || skip "the network cannot be taken away here"
pocl=$(ldconfig -p | awk '$1 ~ /^libpocl\.so\./ { print $NF; exit }')
[ -n "$pocl" ] || skip "there is no PoCL here to pack"
reaches "$debian" bookworm
alone "$0" "$build"

if [ -n "${VSPLAT_BUNDLE_MADE-}" ]; then
  cp "$VSPLAT_BUNDLE_MADE" "$work/vsplat.tar.xz"  # made before: compressing takes minutes
else
  "$tree/cmake/bundle.sh" --build "$build" "$work/vsplat.tar.xz"
fi
"$tree/cmake/wheel.py" "$work/vsplat.tar.xz" "$work" >"$work/wheel"
wheel=$(cat "$work/wheel")
echo "-- archive: $(stat -c %s "$work/vsplat.tar.xz") bytes; wheel: $(stat -c %s "$wheel") bytes, ${wheel##*/}"
mkdir "$work/archive"
tar -C "$work/archive" -xf "$work/vsplat.tar.xz"

# What the build here gives with the driver that was packed.
cat >"$work/reconstruct.py" <<'END'
import sys
import vsplat
device, model = vsplat.Device(), vsplat.Model.load()
device.reconstruct(model, vsplat.Views.load(sys.argv[1]).prepare(model)).save(sys.argv[2])
END
cp -r "$tree/examples/data/garden_gnome" "$work/gnome"
mkdir "$work/expected" "$work/home"
export HOME="$work/home" LC_ALL=C.UTF-8
export OCL_ICD_VENDORS="$pocl"
unset VSPLAT_DEVICE VSPLAT_CACHE_DIR XDG_CACHE_HOME || true
"$build/bin/vsplat" reconstruct "$work/gnome" --output "$work/expected/scene.ply" --quiet
"$build/bin/vsplat" render "$work/expected/scene.ply" --cameras orbit:2 --size 64x64 --images "$work/expected/pictures" --quiet
unset OCL_ICD_VENDORS

# In the bare system. PART is command or wheel.
cat >"$work/run.sh" <<'END'
#!/bin/sh
set -eu
export HOME="/try/home-$1" LC_ALL=C.UTF-8
cd /try
for program in cc gcc clang ld as; do
  if command -v $program; then echo "$program is installed: this system is not bare"; exit 1; fi
done
same() {
  cmp expected/scene.ply "$1/scene.ply"
  for file in expected/pictures/*; do cmp "$file" "$1/pictures/${file##*/}"; done
  echo "same bytes: scene.ply ($(wc -c <"$1/scene.ply")), $(ls expected/pictures | wc -l) pictures"
}
mkdir -p "$HOME" "out/$1"
case $1 in
  command) vsplat=/try/vsplat/bin/vsplat ;;
  wheel)
    python3 -m venv --system-site-packages venv
    venv/bin/pip install --no-index --quiet ./*.whl
    vsplat=/try/venv/bin/vsplat
    ;;
esac
$vsplat --version 2>said
[ ! -s said ]
$vsplat devices 2>said
cat said
grep -q "no OpenCL driver.*uses PoCL" said
$vsplat reconstruct gnome --output "out/$1/scene.ply" --quiet
$vsplat render "out/$1/scene.ply" --cameras orbit:2 --size 64x64 --images "out/$1/pictures" --quiet
same "out/$1"
if [ "$1" = wheel ]; then
  rm -r "$HOME/.cache"  # kernels are compiled and linked from Python, too
  venv/bin/python reconstruct.py gnome "out/$1/scene.ply"
  same "out/$1"
  PYTHONPATH=/try/vsplat/share/vsplat/python python3 reconstruct.py gnome "out/$1/scene.ply"
  same "out/$1"
  venv/bin/pip uninstall --quiet --yes vsplat
  if find venv | grep vsplat; then echo "left behind"; exit 1; fi
fi
# A driver of the machine is not replaced, even by one that works.
mkdir -p /etc/OpenCL/vendors
echo libnone.so >/etc/OpenCL/vendors/none.icd
if /try/vsplat/bin/vsplat devices >none 2>&1; then cat none; exit 1; fi
if grep -q "uses PoCL" none; then cat none; exit 1; fi
OCL_ICD_VENDORS=$(echo /try/vsplat/pocl/lib/*/libpocl.so.*) /try/vsplat/bin/vsplat devices
rm -r /etc/OpenCL
END
chmod 755 "$work/run.sh"
# offline COMMAND...: in the bare system
offline() {
  env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin unshare --net chroot "$root" "$@"
}
for system in $systems; do
  suite=${system%%=*}
  case $system in *=*) from=${system#*=} ;; *) from=$debian ;; esac
  root=$work/$suite
  echo "-- $suite"
  if [ -d "${VSPLAT_BARE_FOLDER-/nowhere}/$suite" ]; then
    cp -a "$VSPLAT_BARE_FOLDER/$suite" "$root"
  else
    make_system "$suite" "$root" "$from"
  fi
  mount_system "$root"
  mkdir -p "$root/try"
  cp -a "$work/archive/vsplat" "$work/gnome" "$work/expected" "$work/run.sh" "$work/reconstruct.py" "$wheel" "$root/try/"
  offline /try/run.sh command
  # The module needs Python and NumPy, which the wheel does not contain. The wheel is for this glibc or a newer one.
  glibc=$(offline getconf GNU_LIBC_VERSION)
  least=$(echo "$wheel" | sed -n 's/.*manylinux_2_\([0-9]*\)_.*/\1/p')
  if [ "${glibc#glibc 2.}" -ge "${least:-0}" ]; then
    within "$root" env DEBIAN_FRONTEND=noninteractive sh -c \
      "apt-get -q update && apt-get -q -y --no-install-recommends install python3-venv python3-numpy" >"$work/log" 2>&1 || { tail -n 20 "$work/log" >&2; exit 1; }
    offline /try/run.sh wheel
  else
    echo "$glibc: older than the wheel's"
  fi
  remove_system "$root"
done
echo "the archive and the wheel ran in: $systems"
