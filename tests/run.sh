#!/bin/sh
# Set-up, build and the tests: all but those labelled slow, or all of them with --all; with --asan, built with the address and
# undefined-behaviour sanitizers; with --strict, as continuous integration runs them: a warning is an error, and a test that is left out for want of what it needs, or
# skipped and not named in tests/may-skip.txt, counts as failed. What follows goes to ctest:
#   tests/run.sh -R gemm
set -eu
cd "$(dirname "$0")/.."

preset=release
label_exclude=slow
strict=OFF
quick=
while :; do
  case ${1-} in
    --asan) preset=asan quick="-DVSPLAT_QUICK_BUILD=ON $quick" ;;
    --all) label_exclude='^$' ;;
    --strict) strict=ON quick="-DVSPLAT_QUICK_BUILD=ON -DVSPLAT_MPI=ON -DVSPLAT_WERROR=ON" ;;
    *) break ;;
  esac
  shift
done

cmake/install-packages.sh --tests
cmake --preset $preset -DVSPLAT_TESTS=ON -DVSPLAT_REQUIRE_ALL_TESTS=$strict $quick
cmake --build --preset $preset
results=$PWD/build/$preset/tests.xml cases=$PWD/build/$preset/test_cases
rm -rf "$cases"
# Half as many again as there are processors: some wait, for a file, a process or a lock of the compiler's.
code=0
ctest --test-dir build/$preset --output-on-failure --no-tests=error --output-junit "$results" -LE "$label_exclude" -j $((($(nproc) * 3 + 1) / 2)) "$@" ||
  code=$?
if [ -s "build/$preset/left_out.txt" ]; then
  echo "Left out, since this system lacks what they need:"
  sed 's/^/  /' "build/$preset/left_out.txt"
fi
if [ $strict = ON ] && [ -f "$results" ]; then
  ctest --test-dir build/$preset --show-only=json-v1 >"$results.names"
  tests/check_skipped.py "$results" "$results.names" "$cases" || code=1
fi
exit $code
