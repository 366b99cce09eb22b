#!/bin/sh
# Makes the pictures of README.md. For each object in examples/data: four of the input pictures side by side, a
# turntable of the network's scene, and one of that scene after fitting. On one device the bytes are always equal.
#   examples/pictures/make.sh [FOLDER]      runs $VSPLAT, else the release build; FOLDER: default here
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
  for made in network fitted; do
    refine=
    if [ $made = fitted ]; then refine=--refine; fi
    # shellcheck disable=SC2086  # an option or none
    "$vsplat" reconstruct "$data" $refine --output "$work/$name-$made.ply" --render orbit:48 --size 256x256 \
      --turntable "$out/$name-$made.webp" --quality 80 --overwrite --quiet
  done
}
object gnome garden_gnome
object skull painted_skull
