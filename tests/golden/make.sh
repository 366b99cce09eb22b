#!/bin/sh
# Golden vectors from the PyTorch specification in tests/reference/pytorch.
#   tests/golden/make.sh                 the committed ones, here (remove a file first to make it anew)
#   tests/golden/make.sh DIR tiny        the larger ones, as ctest's golden_tiny does before the tests that read them
#   tests/golden/make.sh DIR train       those of training, as ctest's golden_train does
#   tests/golden/make.sh DIR splat       scenes to draw, as ctest's golden_splat does; `splat_small` makes the committed ones in splat/
#   tests/golden/make.sh FILE lpips      distances of LPIPS: the committed lpips.safetensors
# Needs a Python with torch >= 1.13 and numpy (Debian: python3-torch python3-numpy); VSPLAT_PYTHON names one. Exits with 77
# where there is none.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
script=make_cases.py
size=${2:-micro}
case $size in
  splat) script=make_splat.py size=large ;;
  splat_small) script=make_splat.py size=small ;;
  lpips) script=make_lpips.py ;;
esac
for python in "${VSPLAT_PYTHON:-}" python3 /usr/bin/python3; do
  if [ -n "$python" ] && "$python" -c 'import numpy, torch' 2>/dev/null; then
    exec "$python" -B "$here/../reference/pytorch/$script" "${1:-$here}" "$size"
  fi
done
echo "no Python with torch and numpy found (VSPLAT_PYTHON, python3, /usr/bin/python3): no golden vectors made" >&2
exit 77
