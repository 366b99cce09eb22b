#!/bin/sh
# Draws the pictures that the shipped model is trained on, OUTPUT/train and, larger, OUTPUT/train192 and OUTPUT/train256, and those that it is
# evaluated on, OUTPUT/test and, larger, OUTPUT/test256, with the same bytes as for that model. README.md in this folder describes the folders of $VSPLAT_DATA
# and their sources.
#   VSPLAT_DATA=DIR model/weights/make-data.sh OUTPUT
# VSPLAT names the program; default: build/release/bin/vsplat.
set -eu
LC_ALL=C  # the order of names determines the patterns
export LC_ALL
if [ $# -ne 1 ] || [ -z "${VSPLAT_DATA-}" ]; then
  echo "usage: VSPLAT_DATA=DIR $0 OUTPUT" >&2
  exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)
vsplat=${VSPLAT:-$here/../../build/release/bin/vsplat}
vsplat=$(cd "$(dirname "$vsplat")" && pwd)/$(basename "$vsplat")
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$VSPLAT_DATA"

# Lists the meshes of scanned objects, one a line: those that held-out.txt names (yes), or those that it does not name (no).
objects() {
  for mesh in gso-textured/*/model.obj household/*/model.obj objects/*.glb; do
    case $mesh in
      *.glb) name=$(basename "$mesh" .glb) ;;
      *) name=$(basename "$(dirname "$mesh")") ;;
    esac
    if grep -qxF "$name" "$here/held-out.txt"; then held=yes; else held=no; fi
    if [ "$held" = "$1" ]; then echo "$mesh"; fi
  done
}
test=$(objects yes)
train=$(objects no)
found=$(echo "$test" | wc -l)
wanted=$(wc -l <"$here/held-out.txt")
if [ "$found" -ne "$wanted" ]; then
  echo "$found of the $wanted objects of held-out.txt are in $VSPLAT_DATA: each must be there once" >&2
  exit 1
fi

# shellcheck disable=SC2086  # lists of paths without blanks
"$vsplat" dataset render $test --output "$out/test" --views 40 --size 128 --seed 7
# shellcheck disable=SC2086
"$vsplat" dataset render $test --output "$out/test256" --views 40 --size 256 --seed 7
# shellcheck disable=SC2086
"$vsplat" dataset render $train --output "$out/train/scans" --views 40 --size 128 --seed 1
# shellcheck disable=SC2086
"$vsplat" dataset render $train --output "$out/train192/scans" --views 40 --size 192 --seed 1
# Each shape four times, with another pattern each time; the first two larger.
patterns=$(ls patterns/*.jpg)
count=$(echo "$patterns" | wc -l)
i=0
for k in 0 1 2 3; do
  for shape in gso-shapes/*/model.obj; do
    pattern=$(echo "$patterns" | sed -n "$((i % count + 1))p")
    i=$((i + 13))
    "$vsplat" dataset render "$shape" --texture "$pattern" --output "$out/train/shapes$k" --views 40 --size 128 --seed $((2 + k))
    if [ "$k" -lt 2 ]; then
      "$vsplat" dataset render "$shape" --texture "$pattern" --output "$out/train192/shapes$k" --views 40 --size 192 --seed $((2 + k))
    fi
  done
done
"$vsplat" dataset procedural --count 300 --solids --output "$out/train/procedural" --views 32 --size 128 --seed 11

# For runs 17 to 19: every textured object but those that measure or choose, and two that look like one of them; flat-coloured ones also with
# patterns; each shape twice.
one() {
  set_name=$1 mesh=$2 seed=$3
  shift 3
  "$vsplat" dataset render "$mesh" --output "$out/train256/$set_name" --views 32 --size 256 --seed "$seed" "$@"
}
pattern_of() { echo "$patterns" | sed -n "$(($1 % count + 1))p"; }
i=0 j=0
for mesh in gso-textured/*/model.obj household/*/model.obj objects/*.glb objects2/*.glb; do
  name=$(basename "$mesh" .glb)
  case $mesh in */model.obj) name=$(basename "$(dirname "$mesh")") ;; esac
  case $name in pc_egyptian_cat_statue | gz_cordless_drill) continue ;; esac
  if cat "$here/held-out.txt" "$here/held-out-2.txt" "$here/choosing.txt" | grep -qxF "$name"; then continue; fi
  i=$((i + 1))
  one scans "$mesh" $((1000 + i))
  case $name in
    kk_* | gz_number* | gz_construction*)
      j=$((j + 13))
      one flat "$mesh" $((2000 + j)) --texture "$(pattern_of "$j")"
      ;;
  esac
done
for k in 0 1; do
  for shape in gso-shapes/*/model.obj; do
    j=$((j + 13))
    one "shapes$k" "$shape" $((3000 + 1000 * k + j)) --texture "$(pattern_of "$j")"
  done
done
