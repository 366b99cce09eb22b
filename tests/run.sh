#!/bin/sh
# Sets up, builds quickly (cmake/VsplatQuickBuild.cmake) and runs the tests: all except those labelled slow.
#   --all     runs the slow tests, too
#   --asan    builds with the address and undefined-behaviour sanitizers
#   --strict  as in continuous integration: warnings are errors, and so are tests that were left out because something is missing, or skipped,
#             unless tests/may-skip.txt names them
# Further arguments go to ctest:
#   tests/run.sh -R gemm
set -eu
cd "$(dirname "$0")/.."

preset=release
label_exclude=slow
strict=OFF
strict_options=
while :; do
  case ${1-} in
    --asan) preset=asan ;;
    --all) label_exclude='^$' ;;
    --strict) strict=ON strict_options="-DVSPLAT_MPI=ON -DVSPLAT_WERROR=ON" ;;
    *) break ;;
  esac
  shift
done

cmake/install-packages.sh --tests
# Mesa's clover loses 128 bytes on AMD's processors, in a module that it unloads, so that no suppression can name it.
if [ $preset = asan ] && [ -f /etc/OpenCL/vendors/pocl.icd ]; then export OCL_ICD_VENDORS="${OCL_ICD_VENDORS-/etc/OpenCL/vendors/pocl.icd}"; fi
cmake --preset $preset -DVSPLAT_TESTS=ON -DVSPLAT_QUICK_BUILD=ON -DVSPLAT_REQUIRE_ALL_TESTS=$strict $strict_options
cmake --build --preset $preset
results=$PWD/build/$preset/tests.xml cases=$PWD/build/$preset/test_cases
rm -rf "$cases"
# One and a half times as many tests at once as there are processors, since some wait for a file, a process or a compiler's lock.
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
