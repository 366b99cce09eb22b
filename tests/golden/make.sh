#!/bin/sh
# Golden vectors from the PyTorch specification in tests/reference/pytorch.
#   tests/golden/make.sh                 the committed ones, here (remove a file first to make it again)
#   tests/golden/make.sh DIR tiny        the larger ones, as ctest's golden_tiny does before the tests that read them
#   tests/golden/make.sh DIR tiny_slow   two seeds more of them, as ctest's golden_tiny_slow does
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
# Keeps glibc from returning their memory after each use, which takes a quarter of the processor's time.
export MALLOC_MMAP_THRESHOLD_=4294967296 MALLOC_TRIM_THRESHOLD_=8589934592 MALLOC_TOP_PAD_=67108864
exec "$here/../reference/pytorch/run.sh" $script "${1:-$here}" "$size"
