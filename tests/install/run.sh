#!/bin/sh
# Installs a build, then builds and runs a project that knows only the installed files, from another directory.
#   tests/install/run.sh BUILD_DIR
set -eu
build=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cmake --install "$build" --prefix "$work/first" >/dev/null
mv "$work/first" "$work/moved"  # the package must not depend on the folder that it was installed to
cp -r "$here" "$work/project"
static=OFF
if [ -n "$(find "$work/moved" -name libvsplat.a)" ]; then static=ON; fi
cmake -S "$work/project" -B "$work/build" -DCMAKE_PREFIX_PATH="$work/moved" -DSTATIC=$static >/dev/null
cmake --build "$work/build" >/dev/null
cd "$work"
unset VSPLAT_KERNEL_DIR || true
"$work/build/user_c"
"$work/build/user_cpp"
if [ $static = ON ]; then
  "$work/build/user_static"
  if ldd "$work/build/user_static" | grep libvsplat; then echo "libvsplat.so, though the archive was linked" >&2; exit 1; fi
fi
"$work/moved/bin/vsplat" --version
for file in LICENSE CREDITS.md examples/fit.c examples/garden_gnome/transforms.json; do
  [ -s "$work/moved/share/doc/vsplat/$file" ] || { echo "share/doc/vsplat/$file is not installed" >&2; exit 1; }
done
# A program beside the library reads meshes.
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n' >"$work/mesh.obj"
"$work/moved/bin/vsplat" dataset render "$work/mesh.obj" --output "$work/set" --views 1 --size 16 --quiet
# Benchmarks, too.
"$work/moved/bin/vsplat" bench scan --seconds 0.02 --quiet
# The built-in model, if there is one.
if [ -f "$here/../../model/weights/model.safetensors" ]; then "$work/moved/bin/vsplat" weights verify; fi

library=$(dirname "$(find "$work/moved" -name vsplat.pc)")
flags=$(PKG_CONFIG_PATH=$library pkg-config --cflags --libs vsplat)
# shellcheck disable=SC2086  # a list of flags
cc -std=c99 "$here/user.c" $flags -Wl,-rpath,"$(dirname "$library")" -o "$work/by_pkg_config"
"$work/by_pkg_config"
if grep -rl "$build\|$(dirname "$(dirname "$here")")" "$work/moved/lib" "$work/moved/include" --include='*.cmake' --include='*.h' --include='*.pc'; then
  echo "the files above name the build or source directory" >&2
  exit 1
fi
