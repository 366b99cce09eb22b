#!/bin/sh
# run.sh SCRIPT ARGUMENTS...: runs one of the scripts here with a Python that has torch >= 1.13 and numpy (Debian: python3-torch
# python3-numpy); VSPLAT_PYTHON names one. Exits with 77 where there is none.
set -eu
script=$(cd "$(dirname "$0")" && pwd)/$1
shift
for python in "${VSPLAT_PYTHON:-}" python3 /usr/bin/python3; do
  if [ -n "$python" ] && "$python" -c 'import numpy, torch' 2>/dev/null; then
    exec "$python" -B "$script" "$@"
  fi
done
echo "no Python with torch and numpy found (VSPLAT_PYTHON, python3, /usr/bin/python3): $(basename "$script") is not run" >&2
exit 77
