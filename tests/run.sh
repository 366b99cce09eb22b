#!/bin/sh
# Set-up, build and the tests: all but those labelled slow, or all of them with --all. What follows goes to ctest:
#   tests/run.sh -R gemm
set -eu
cd "$(dirname "$0")/.."

label_exclude=slow
if [ "${1-}" = --all ]; then
  label_exclude='^$'
  shift
fi

cmake/install-packages.sh --tests
cmake --preset release -DVSPLAT_TESTS=ON
cmake --build --preset release
# Tests of one device beside each other take longer in all than in pairs.
ctest --test-dir build/release --output-on-failure -LE "$label_exclude" -j "$(nproc)" "$@"
