#!/bin/sh
# Coverage-guided fuzzing of the readers: builds the targets (build/fuzz) and runs them, so many seconds each.
#   tests/fuzz/run.sh SECONDS [TARGET...]      targets: the folders of corpus/; default: all
#   tests/fuzz/run.sh build                    only builds
#   tests/fuzz/run.sh run SECONDS [TARGET...]  only runs
# VSPLAT_FUZZ_SEED sets the seed, VSPLAT_FUZZ_RUNS the maximum number of inputs. An input that breaks something is stored in
# build/fuzz/found. With the fix it goes into tests/fuzz/regressions/TARGET, which the test `fuzz_replay_test` reads in every build.
set -eu
cd "$(dirname "$0")/../.."

mode=${1:?SECONDS, build or run is expected}
if [ "$mode" != run ]; then
  cmake --preset fuzz >/dev/null
  cmake --build --preset fuzz
  [ "$mode" != build ] || exit 0
else
  shift
fi
seconds=${1:?SECONDS is expected}
shift
# shellcheck disable=SC2046  # a list of words
[ $# -gt 0 ] || set -- $(ls tests/fuzz/corpus)

for target; do
  data=tests/fuzz
  grown=build/fuzz/corpus/$target  # what libFuzzer adds; the committed seeds are only read
  mkdir -p "$grown" build/fuzz/found
  case $target in
    picture_*) words=picture ;;
    checkpoint | fit_checkpoint | model) words=tensors ;;
    *) words=$target ;;
  esac
  seeds=$data/corpus/$target
  [ ! -d $data/regressions/"$target" ] || seeds="$seeds $data/regressions/$target"
  # The memory limit is far above what these inputs need, and far below what trusting a wrong count would take.
  # shellcheck disable=SC2086  # lists of words
  build/fuzz/tests/fuzz/fuzz_"$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=256 \
    -max_len=65536 -seed="${VSPLAT_FUZZ_SEED:-0}" -runs="${VSPLAT_FUZZ_RUNS:--1}" -dict=$data/$words.dict \
    -artifact_prefix=build/fuzz/found/"$target"- -print_final_stats=1 "$grown" $seeds >build/fuzz/found/"$target".log 2>&1 || {
    tail -n 60 build/fuzz/found/"$target".log >&2
    echo "fuzz_$target has found something: see build/fuzz/found" >&2
    exit 1
  }
  echo "fuzz_$target: $(grep '^Done' build/fuzz/found/"$target".log), $(grep peak_rss build/fuzz/found/"$target".log)"
done
