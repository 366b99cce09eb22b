#!/bin/sh
# Makes the Debian packages of a build and tests them in a bare Debian 12 made by debootstrap: they install with their dependencies, the
# command works on an example, programs can be built and run with the library, and removing the packages leaves nothing behind.
#   tests/install/packages.sh BUILD_DIR
# Downloads some 300 MiB. Exits with 77 without debootstrap, without permission to mount and chroot, or if Debian's packages cannot be
# reached.
set -eu
build=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
test=packages
. "$here/../systems/bare.sh"
if grep -q '^VSPLAT_SANITIZE:BOOL=ON' "$build/CMakeCache.txt"; then skip "a build with sanitizers is not packed"; fi
needs
reaches "$debian" bookworm
alone "$0" "$build"
root=$work/debian

cpack --config "$build/CPackConfig.cmake" -B "$work/packages" >"$work/cpack.log" 2>&1 || { cat "$work/cpack.log" >&2; exit 1; }
rm -rf "$work/packages/_CPack_Packages"
libdir=$(sed -n 's/^CMAKE_INSTALL_LIBDIR:[A-Z]*=//p' "$build/CMakeCache.txt")
for name in libvsplat1 libvsplat1-data libvsplat-dev vsplat vsplat-window; do
  set -- "$work/packages/$name"_*.deb
  [ $# -eq 1 ] && [ -f "$1" ] || fail "no package $name, or several: $*"
  dpkg-deb --info "$1" | sed -n 's/^ \(Package\|Version\|Maintainer\|Installed-Size\|Depends\|Recommends\):/  \1:/p'
  echo "  $(stat -c %s "$1") bytes"
  dpkg-deb --contents "$1" >"$work/contents"
  grep -q " ./usr/share/doc/$name/copyright$" "$work/contents" || fail "$name has no copyright"
  if grep -v " \./$\| \./usr/" "$work/contents"; then fail "$name has the files above, which are not in /usr"; fi
done
case $libdir in
  lib/*-linux-gnu) ;;
  *) echo "note: this build was configured with CMAKE_INSTALL_LIBDIR=$libdir, which is not Debian's folder" >&2 ;;
esac

make_system bookworm "$root" "$debian"
mount_system "$root"
mkdir "$root/try"
cp "$work"/packages/*.deb "$root/try/"
cp -r "$here" "$root/try/project"
cat >"$root/try/run.sh" <<'END'
#!/bin/sh
# In the bare system: run.sh LIBDIR
set -eu
export DEBIAN_FRONTEND=noninteractive HOME=/try/home LC_ALL=C.UTF-8
apt="apt-get -q -y -o Dpkg::Use-Pty=0"
said() {
  if ! "$@" >/try/log 2>&1; then
    tail -n 40 /try/log
    echo "failed: $*"
    exit 1
  fi
}
mkdir -p $HOME
cd /try
said $apt update
said $apt install --no-install-recommends gcc g++ libc6-dev make cmake pkg-config
find /usr /etc /var/lib /opt | sort >/try/before
said $apt install ./libvsplat1_*.deb ./libvsplat-dev_*.deb ./vsplat_*.deb
said dpkg --audit

echo "-- the command"
[ -e "/usr/$1/libvsplat.so.1" ]
vsplat --version
vsplat devices
vsplat reconstruct /usr/share/doc/vsplat/examples/garden_gnome --output gnome.ply --refine --render orbit:8 --turntable gnome.webp \
  --size 128x128 --quiet
[ -s gnome.ply ] && [ -s gnome.webp ]
vsplat bench scan --seconds 0.02 --quiet
echo "-- data sets, with their package"
if dpkg -l | grep -q "libembree\|libassimp\|libhdf5"; then echo "what data sets need came with the library"; exit 1; fi
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n' >mesh.obj
if vsplat dataset procedural --count 1 --output set --views 1 --size 16 --quiet 2>err; then echo "drawn without the package"; exit 1; fi
grep -q "package libvsplat1-data" err || { cat err; exit 1; }
said $apt install ./libvsplat1-data_*.deb
dpkg -L libvsplat1 libvsplat1-data libvsplat-dev vsplat | sort -u >/try/ours
vsplat dataset render mesh.obj --output set --views 1 --size 16 --quiet
if vsplat weights verify >weights 2>&1; then cat weights; else grep -q "without" weights; fi
for file in man/man1/vsplat.1 man/man1/vsplat-reconstruct.1 bash-completion/completions/vsplat zsh/site-functions/_vsplat \
  fish/vendor_completions.d/vsplat.fish vsplat/python/vsplat/__init__.py doc/libvsplat1/copyright doc/vsplat/CREDITS.md; do
  [ -s "/usr/share/$file" ] || { echo "/usr/share/$file is missing"; exit 1; }
done

echo "-- a program in C, by pkg-config"
pkg-config --modversion vsplat
for program in fit reconstruct; do
  cc -std=c99 -O1 "/usr/share/doc/vsplat/examples/$program.c" $(pkg-config --cflags --libs vsplat) -lm -o $program
done
./fit before.png after.png
./reconstruct /usr/share/doc/vsplat/examples/garden_gnome scene.ply picture.png
[ -s before.png ] && [ -s after.png ] && [ -s scene.ply ] && [ -s picture.png ]

echo "-- programs in C and C++, by find_package"
said cmake -S project -B build
said cmake --build build
build/user_c
build/user_cpp
if ldd build/user_cpp fit /usr/bin/vsplat | grep vsplat.so | grep -v "/$1/"; then echo "not the installed library"; exit 1; fi

echo "-- removed"
said $apt purge vsplat libvsplat-dev libvsplat1-data libvsplat1
while read -r path; do
  if [ -L "$path" ] || [ -f "$path" ]; then echo "$path is still there"; exit 1; fi
done </try/ours
said $apt autoremove --purge
find /usr /etc /var/lib /opt | sort >/try/after
comm -13 before after | grep vsplat >left || true
if [ -s left ]; then echo "left behind:"; cat left; exit 1; fi
END
chmod 755 "$root/try/run.sh"
within "$root" /try/run.sh "$libdir"
echo "installed, used, removed"
