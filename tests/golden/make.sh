#!/bin/sh
# Makes golden vectors with the PyTorch specification in tests/reference/pytorch.
#   tests/golden/make.sh                 the committed ones, here (to make one again, remove the file first)
#   tests/golden/make.sh DIR tiny        the larger ones, like ctest's golden_tiny before the tests that read them
#   tests/golden/make.sh DIR tiny_slow   two more seeds of them, like ctest's golden_tiny_slow
#   tests/golden/make.sh DIR train       those for training, like ctest's golden_train; `train_slow` makes the others
#   tests/golden/make.sh DIR splat       scenes to draw, like ctest's golden_splat; `splat_small` makes the committed ones in splat/
#   tests/golden/make.sh DIR surfels     the same for surfels; `surfels_small` makes the committed ones in splat/
#   tests/golden/make.sh FILE lpips      distances by LPIPS: the committed lpips.safetensors
# Exits with 77 if there is no Python with torch, see run.sh there.
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
# Its tensors are small: a second thread uses half as much processor time again, or more, and saves almost no elapsed time.
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"
# Keeps glibc from returning their memory after each use, which takes a quarter of the processor's time.
export MALLOC_MMAP_THRESHOLD_=4294967296 MALLOC_TRIM_THRESHOLD_=8589934592 MALLOC_TOP_PAD_=67108864
exec "$here/../reference/pytorch/run.sh" $script "${1:-$here}" "$size"
