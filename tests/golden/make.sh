#!/bin/sh
# Golden vectors from the PyTorch specification in tests/reference/pytorch.
#   tests/golden/make.sh                 the committed ones, here (remove a file first to make it anew)
#   tests/golden/make.sh DIR tiny        the larger ones, as ctest's golden_tiny does before the tests that read them
#   tests/golden/make.sh DIR train       those of training, as ctest's golden_train does; `train_slow` the rest of them
#   tests/golden/make.sh DIR splat       scenes to draw, as ctest's golden_splat does; `splat_small` makes the committed ones in splat/
#   tests/golden/make.sh DIR surfels     the same of surfels; `surfels_small` makes the committed ones in splat/
#   tests/golden/make.sh FILE lpips      distances of LPIPS: the committed lpips.safetensors
# Exits with 77 where there is no Python with torch, see run.sh there.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
script=make_cases.py
size=${2:-micro}
case $size in
  splat) script=make_splat.py size=large ;;
  splat_small) script=make_splat.py size=small ;;
  surfels | surfels_small) script=make_surfels.py ;;
  lpips) script=make_lpips.py ;;
esac
# Its tensors are small: a second thread takes half as much again of the processor's time, or more, and saves next to none of ours.
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"
case $size in
  micro|tiny)  # and LaRa's and GenDen's; of micro where it is not there, with the lists of the published sizes' parameters
    if [ $size = micro ]; then
      for system in lara genden; do
        if [ ! -e "${1:-$here}/${system}_parameters.txt" ]; then
          "$here/../reference/pytorch/run.sh" $([ $system = lara ] && echo lara_reference.py || echo genden_reference.py genden) published |
            tr -s " " > "${1:-$here}/${system}_parameters.txt"
        fi
      done
    fi
    for lara in $([ $size = micro ] && echo micro || echo tiny tiny_gaussian micro_gaussian); do
      made=${1:-$here}/lara_$lara.safetensors
      if [ ! -e "$made" ] || { [ $size != micro ] && [ -n "$(find "$here/../reference/pytorch" -name '*.py' -newer "$made")" ]; }; then
        "$here/../reference/pytorch/run.sh" make_published.py --system lara --size "$lara" --tests --output "${1:-$here}" \
          --seed $([ $lara = tiny ] && echo 2000 || echo 0)  # the first that is far from all thresholds
      fi
    done
    for genden in $([ $size = micro ] && echo micro || echo tiny tiny_residual); do
      made=${1:-$here}/genden_$genden.safetensors
      if [ ! -e "$made" ] || { [ $size != micro ] && [ -n "$(find "$here/../reference/pytorch" -name '*.py' -newer "$made")" ]; }; then
        "$here/../reference/pytorch/run.sh" make_published.py --system genden --size "${genden%_residual}" --tests --output "${1:-$here}" \
          $([ "${genden%_residual}" = "$genden" ] || echo --residual) --seed $([ $genden = micro ] && echo 0 || echo 1000)
      fi
    done
    made=${1:-$here}/vsplat+genden_tiny.safetensors
    if [ $size = tiny ] && { [ ! -e "$made" ] || [ -n "$(find "$here/../reference/pytorch" -name '*.py' -newer "$made")" ]; }; then
      "$here/../reference/pytorch/run.sh" make_published.py --system vsplat+genden --tests --output "${1:-$here}"
    fi ;;
esac
case $size in
  micro|tiny)  # and the extensions'; of micro the small ones are committed
    for made in $([ $size = micro ] && echo dinov3:micro:small share:micro:small ||
                  echo dinov3:micro:large share:micro:large dinov3:tiny:all share:tiny:all); do
      what=${made%%:*} rest=${made#*:}
      edge=${rest%%:*} part=${rest#*:}
      last=${1:-$here}/${what}_${edge}_$([ "$part" = small ] && { [ "$what" = share ] && echo aligned || echo wide; } || echo model).safetensors
      if [ ! -e "$last" ] || { [ $size != micro ] && [ -n "$(find "$here/../reference/pytorch" -name '*.py' -newer "$last")" ]; }; then
        "$here/../reference/pytorch/run.sh" make_extensions.py --what "$what" --size "$edge" --part "$part" --output "${1:-$here}"
      fi
    done ;;
esac
exec "$here/../reference/pytorch/run.sh" $script "${1:-$here}" "$size"
