#!/bin/sh
# Makes the pictures of README.md: of each object in examples/data four of the pictures that go in, side by side, the
# scene that the network makes of them turning, and that scene refined. On one device the same bytes every time.
#   examples/pictures/make.sh [FOLDER]      with $VSPLAT, else the release build's; FOLDER: here
set -eu
here=$(cd "$(dirname "$0")" && pwd)
vsplat=${VSPLAT:-$here/../../build/release/bin/vsplat}
out=${1:-$here}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# object NAME FOLDER
object() {
  name=$1
  data=$here/../data/$2
  shift 2
  "$vsplat" dataset info "$data" --sheet "$out/$name-in.png" --overwrite --quiet
  for made in network refined; do
    refine=
    if [ $made = refined ]; then refine=--refine; fi
    # shellcheck disable=SC2086  # an option or none
    "$vsplat" reconstruct "$data" $refine --output "$work/$name-$made.ply" --render orbit:48 --size 256x256 \
      --turntable "$out/$name-$made.webp" --quality 80 --overwrite --quiet
  done
}
object gnome garden_gnome
object skull painted_skull
