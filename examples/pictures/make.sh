#!/bin/sh
# Makes the pictures of README.md: of each object in examples/data the four pictures that go in, side by side, and the
# scene made of them turning. On one device the same bytes every time.
#   examples/pictures/make.sh [FOLDER]      with $VSPLAT, else the release build's; FOLDER: here
set -eu
here=$(cd "$(dirname "$0")" && pwd)
vsplat=${VSPLAT:-$here/../../build/release/bin/vsplat}
out=${1:-$here}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# object NAME FOLDER OPTIONS...
object() {
  name=$1
  data=$here/../data/$2
  shift 2
  "$vsplat" dataset info "$data" --sheet "$out/$name-in.png" --overwrite --quiet
  "$vsplat" reconstruct "$data" --output "$work/$name.ply" --render orbit:48 --size 256x256 \
    --turntable "$out/$name-out.webp" --overwrite --quiet "$@"
}
object gnome garden_gnome
object skull painted_skull
