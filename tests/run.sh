#!/bin/sh
# Set-up, build and the tests: all but those labelled slow, or all of them with --all; with --asan before that, built with the address
# and undefined-behaviour sanitizers. What follows goes to ctest:
#   tests/run.sh -R gemm
set -eu
cd "$(dirname "$0")/.."

preset=release
if [ "${1-}" = --asan ]; then
  preset=asan
  shift
fi
label_exclude=slow
if [ "${1-}" = --all ]; then
  label_exclude='^$'
  shift
fi

cmake/install-packages.sh --tests
cmake --preset $preset -DVSPLAT_TESTS=ON
cmake --build --preset $preset
# Tests of one device beside each other take longer in all than in pairs.
ctest --test-dir build/$preset --output-on-failure -LE "$label_exclude" -j "$(nproc)" "$@"
