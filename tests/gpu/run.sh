#!/bin/sh
# Compares the kernels of the gpu flavour, as the compilers of GPU drivers compile them (static_check.py), with
# bench/results/gpu-compilers.txt: all kernels that jobs launch with the built-in model and with small models of the other networks, and the
# variants for smaller devices. Compiled kernels are cached by their text.
#   tests/gpu/run.sh VSPLAT WORK [OPTIONS of static_check.py]
#   tests/gpu/run.sh VSPLAT WORK --table bench/results/gpu-compilers.txt      writes the table again
# Exits with 77 if the compilers are not available.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
vsplat=$1 work=$2
shift 2
mkdir -p "$work"
"$here/fetch_compilers.sh" "$work/compilers"
dump() { "$vsplat" kernels --no-build --overwrite --quiet --dump "$work/$1" ${2:+--model "$2"} >/dev/null; }
rm -rf "$work/own"
dump own
set -- "$work/own" "$@"
# The emulated products of mixed precision; those for a vendor's matrix units are in every dump, only for that vendor's compiler.
VSPLAT_MATRIX=emulated "$vsplat" kernels --no-build --overwrite --quiet --dump "$work/mixed" --precision mixed --for reconstruct >/dev/null
python3 -c 'import json, sys
rows = [row for row in json.load(open(sys.argv[1])) if row["name"].startswith("gemm_matrix")]
json.dump(rows, open(sys.argv[1], "w"))' "$work/mixed/kernels.json"
set -- "$work/mixed" "$@"
for limits in group=128 local=16K; do
  rm -rf "${work:?}/$limits"
  VSPLAT_LIMITS=$limits dump "$limits"
  set -- "$work/$limits" "$@"
done
for system in lara genden vsplat+genden; do
  "$vsplat" init small --system $system --seed 1 --output "$work/$system.safetensors" --overwrite --quiet
  rm -rf "${work:?}/$system"
  dump $system "$work/$system.safetensors"
  rm "$work/$system.safetensors"
  set -- "$work/$system" "$@"
done
exec "$here/static_check.py" --intel "$work/compilers" --cache "$work/cache" "$@"
