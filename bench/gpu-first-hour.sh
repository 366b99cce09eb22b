#!/bin/sh
# What a GPU that this has never run on is asked first, in steps that each take at most eight minutes and survive each other, the most telling
# first. On a machine with the GPU's driver and nothing else, what cmake/bundle.sh packs (--tests) is all that it needs.
#
#   bench/gpu-first-hour.sh [OPTION...] OUTPUT [STEP...]
#
# OUTPUT is a folder, made where there is none: STEP.tar.gz for each step, below 16 MiB, and summary.txt, a line for each. Steps that are called
# later add theirs. Without a STEP all are done:
#   doctor     what there is: vsplat doctor, report with a standard run, nvidia-smi
#   selftest   every kernel against the reference on this driver, where vsplat has that command; the other steps run whatever its verdict
#   tests      the kernels' test programs, where they were packed
#   tune       the fastest kernels for the network of paper, kept in the cache of the steps that follow
#   paper      the paper-size network, random weights, 4 pictures in and 8 out, twice without and twice with the tuned kernels: time and profile
#   mixed      the same with --precision mixed beside fp32, and the difference of the pictures, where vsplat has that
#   bench      every suite of vsplat bench with its profile, one after the other while there is time
#
#   --minutes M        that a step may take (8; a number, 0.5 is half a minute)
#   --device NAME      as vsplat takes it (gpu: the first one); "cpu" tries the script out
#   --config NAME      the size of the network in tune, paper and mixed (paper)
#   --search S         seconds that tune searches (what its step has, less 30)
#   --suites A,B,...   of bench, in this order (all: the dense kernels, drawing and training first)
#   --seconds S        for each case of bench (0.3)
#   --tests FILTER     which tests, as --gtest_filter takes it (*)
#   --work DIR         where it works, with the cache of compiled kernels (OUTPUT.work)
#
# VSPLAT names the program, where it is not found beside this file. Exit codes: 0, 1 where a step failed, 2 for wrong options.
# shellcheck disable=SC2317 # steps are called by their names
set -eu
LC_ALL=C
export LC_ALL

say() { printf 'gpu-first-hour: %s\n' "$*" >&2; }
fail() {
  say "$*"
  exit 1
}
usage() {
  say "$*; --help tells the options"
  exit 2
}
now() { date +%s; }

all_steps="doctor selftest tests tune paper mixed bench"
minutes=8 device='' config=paper suites='' seconds=0.3 filter='*' work='' output='' steps='' most_search=''
while [ $# -gt 0 ]; do
  case $1 in
    -h | --help)
      sed -n '2,/^set -eu/{/^set -eu/d;/^# shellcheck/d;s/^# \{0,1\}//;p;}' "$0"
      exit 0
      ;;
    --minutes | --device | --config | --search | --suites | --seconds | --tests | --work)
      [ $# -gt 1 ] || usage "$1 needs a value"
      case $1 in
        --minutes) minutes=$2 ;;
        --device) device=$2 ;;
        --config) config=$2 ;;
        --search) most_search=$2 ;;
        --suites) suites=$(printf '%s' "$2" | tr ',' ' ') ;;
        --seconds) seconds=$2 ;;
        --tests) filter=$2 ;;
        --work) work=$2 ;;
      esac
      shift
      ;;
    -*) usage "$1 is no option" ;;
    *)
      if [ -z "$output" ]; then
        output=$1
      else
        case " $all_steps " in *" $1 "*) steps="$steps $1" ;; *) usage "$1 is no step: there are $all_steps" ;; esac
      fi
      ;;
  esac
  shift
done
[ -n "$output" ] || usage "OUTPUT is missing"
case $minutes in '' | *[!0-9.]* | *.*.*) usage "--minutes is \"$minutes\": a number of minutes expected" ;; esac
limit=$(awk -v m="$minutes" 'BEGIN { print int(m * 60 + 0.5) }')
[ "$limit" -ge 1 ] || usage "--minutes is \"$minutes\": at least a second expected"

mkdir -p "$output" "${work:=$output.work}"
output=$(cd "$output" && pwd)
work=$(cd "$work" && pwd)
top=$(cd "$(dirname "$0")/.." && pwd)
. "$top/bench/gpu-driver.sh"
for program in timeout tar gzip awk; do
  command -v $program >/dev/null || fail "this machine has no $program"
done
find_vsplat
: "${HOME:=$work}" "${VSPLAT_CACHE_DIR:=$work/cache}" "${POCL_CACHE_DIR:=$work/pocl}"
# What the self-test finds is in its note, and ends no step that follows.
VSPLAT_SELFTEST=ignore
export HOME VSPLAT_CACHE_DIR POCL_CACHE_DIR VSPLAT_SELFTEST
(umask 077 && mkdir -p "$VSPLAT_CACHE_DIR" "$POCL_CACHE_DIR") || :

child='' stopped=no
trap 'stopped=yes; [ -z "$child" ] || kill -TERM "$child" 2>/dev/null || :' INT TERM HUP

# left: seconds that the step still has
left() { echo $((step_end - $(now))); }
# run NAME COMMAND...: into $dir/NAME.out and NAME.err, within the step's time, or $most of it. -> its exit code; 124 where it took too long
most=''
run() {
  name=$1
  shift
  time=$(left)
  if [ -n "$most" ] && [ "$most" -lt "$time" ]; then time=$most; fi
  if [ "$stopped" = yes ] || [ "$time" -lt 1 ]; then
    echo "not begun: the step's $limit s are over" >"$dir/$name.err"
    return 124
  fi
  run_begun=$(now)
  timeout -k 10 "$time" "$@" >"$dir/$name.out" 2>"$dir/$name.err" </dev/null &
  child=$!
  code=0
  wait "$child" || code=$?
  # A signal ends the first wait, and the program a little later.
  if [ "$stopped" = yes ]; then wait "$child" 2>/dev/null || :; fi
  child=
  printf '%s\t%s\t%s s\t%s\n' "$name" "$code" "$(($(now) - run_begun))" "$*" >>"$dir/commands.txt"
  return $code
}
has_command() { "$vsplat" help "$1" >/dev/null 2>&1; }
has_option() { "$vsplat" help "$1" 2>/dev/null | grep -q -- "$2"; }
# note TEXT: for the step's line of the summary
notes=''
note() { notes="$notes${notes:+; }$*"; }
# last_message FILE: the last line of what a program said of itself
last_message() { grep -v '^$' "$dir/$1.err" 2>/dev/null | tail -n 1 | cut -c 1-300; }
seconds_in() { field seconds <"$dir/$1.out" | awk '{ printf "%.3f", $1 }'; }

# From a profile: the seconds in which the device ran something, the network and the drawing.
device_seconds() {
  sed -n 's/^ *"device_s": *\([0-9.e+-]*\).*$/\1/p' "$1" 2>/dev/null | head -n 1 | awk '{ printf "%.4f", $1 }'
}

step_doctor() {
  bad=0
  run nvidia-smi nvidia-smi -q || :
  # As the machine is, and with the entry that may have been made.
  run doctor-as-found env -u OCL_ICD_VENDORS ${found_vendors:+"OCL_ICD_VENDORS=$found_vendors"} LD_LIBRARY_PATH="$found_libraries" "$vsplat" doctor || :
  run doctor "$vsplat" doctor || note "$(last_message doctor)"
  run doctor-json "$vsplat" doctor --json || :
  run devices "$vsplat" devices --json || bad=1
  run report-no-run "$vsplat" report --no-run --overwrite --output "$dir/report.json" || bad=1
  if [ -n "$device" ]; then run report "$vsplat" report --device "$device" --overwrite --output "$dir/report.json" || bad=1; fi
  note "$(sed -n '/^device /p' "$dir/report.err" 2>/dev/null)"
  return $bad
}

step_selftest() {
  has_command selftest || return 77
  code=0
  run selftest env -u VSPLAT_SELFTEST "$vsplat" selftest --device "$device" --json || code=$?
  note "verdict: $(field verdict <"$dir/selftest.out")"
  note "$(last_message selftest)"
  return $code
}

step_tests() {
  bad=0 found=no
  for name in ops_tests runtime_tests; do
    for file in "$top/tests/$name" "$top/build/release/tests/$name"; do
      if [ ! -f "$file" ] || [ ! -x "$file" ]; then continue; fi
      found=yes
      run $name env VSPLAT_DEVICE="$device" "$file" --gtest_brief=1 "--gtest_filter=$filter" || bad=1
      note "$name: $(grep -c '^\[  FAILED  \] [^(]*(' "$dir/$name.out") failed, $(sed -n 's/^\[  PASSED  \] \([0-9]*\) .*/\1/p' "$dir/$name.out") passed"
      break
    done
  done
  [ $found = yes ] || return 77
  return $bad
}

step_tune() {
  has_command tune || return 77
  prepare || return 1
  code=0
  search=${most_search:-$(($(left) - 30))}
  if [ "$search" -lt 1 ]; then search=1; fi
  run tune "$vsplat" tune --quick --model "$model" --seconds "$search" --device "$device" --json || code=$?
  note "$(field tried <"$dir/tune.out") sets tried"
  return $code
}

# The network's weights and pictures of an object for it; a tenth of the voxels, nearest the middle, since random weights select anything.
prepare() {
  model=$work/$config.safetensors
  if [ ! -f "$model" ]; then run init "$vsplat" init "$config" --seed 1 --output "$model" --quiet || return 1; fi
  run info "$vsplat" weights info "$model" --json || return 1
  size=$(field image <"$dir/info.out") volume=$(field volume <"$dir/info.out")
  views=$work/views-$size
  if [ ! -d "$views" ]; then run draw "$vsplat" dataset procedural --count 1 --solids --views 12 --size "$size" --seed 4711 --output "$views" --quiet || return 1; fi
  awk -v n="$volume" 'BEGIN {
    r = n * exp(log(0.1 * 3 / 4 / 3.14159265) / 3); c = (n - 1) / 2
    for (i = 0; i < n; ++i) for (j = 0; j < n; ++j) for (k = 0; k < n; ++k)
      if ((i - c) ^ 2 + (j - c) ^ 2 + (k - c) ^ 2 < r * r) print (i * n + j) * n + k }' >"$work/selection-$volume"
}

# reconstruct NAME OPTION...: 4 pictures in and 8 out, into $dir/NAME; the first time compiles, the second is what counts
reconstruct() {
  kind=$1
  shift
  for time_of in first second; do
    run "$kind-$time_of" env VSPLAT_TUNING="$tuning" "$vsplat" reconstruct "$views/solid_0000" --model "$model" --view-count 4 --selection "$work/selection-$volume" \
      --output "$work/$kind.ply" --render orbit:8 --images "$dir/$kind" --write-cameras "$work/$kind-cameras.json" --profile "$dir/$kind-$time_of.json" --device "$device" --json --overwrite "$@" || {
      note "$kind: $(last_message "$kind-$time_of")"
      return 1
    }
    note "$kind, $time_of time: $(seconds_in "$kind-$time_of") s, of them $(device_seconds "$dir/$kind-$time_of.json") on the device"
  done
  note "$kind, table: $(field tuning <"$dir/$kind-second.out")"
}

step_paper() {
  prepare || return 1
  bad=0
  tuning=off
  reconstruct "$config" || bad=1
  tuning=${VSPLAT_TUNING-}
  reconstruct "$config-tuned" || bad=1
  return $bad
}

step_mixed() {
  has_option reconstruct --precision || return 77
  prepare || return 1
  bad=0 tuning=${VSPLAT_TUNING-}
  reconstruct fp32 --precision fp32 || bad=1
  reconstruct mixed --precision mixed || bad=1
  run differences "$vsplat" render "$work/mixed.ply" --cameras "$work/fp32-cameras.json" --compare "$dir/fp32" --device "$device" --json || bad=1
  note "mixed against fp32: $(field psnr <"$dir/differences.out") dB"
  return $bad
}

step_bench() {
  bad=0 late=0
  if [ -z "$suites" ]; then
    # What there is, in the words that refuse what there is not; the longest work first.
    there=$("$vsplat" bench none 2>&1 | sed -n 's/^.*not in {\(.*\)}.*$/\1/p' | tr ',' ' ')
    for suite in model gemm conv3d attention render train fit $there; do
      case " $there " in *" $suite "*) ;; *) continue ;; esac
      case " $suites " in *" $suite "*) ;; *) suites="$suites $suite" ;; esac
    done
  fi
  for suite in $suites; do
    # One that takes long leaves time for others.
    code=0 most=$(($(left) / 2))
    run "bench-$suite" "$vsplat" bench "$suite" --seconds "$seconds" --device "$device" --json --profile "$dir/bench-$suite.json" --overwrite || code=$?
    case $code in 0) ;; 124 | 130) late=$((late + 1)) ;; *) bad=$((bad + 1)) ;; esac
  done
  most=
  note "$(($(echo "$suites" | wc -w))) suites, $bad failed, $late without time"
  [ $bad = 0 ] && [ $late = 0 ]
}

# pack STEP: its files, the largest left out until they fit
pack() {
  rm -f "$output/$1.tar.gz"
  while :; do
    tar -C "$work" -cf - "$1" | gzip -6 >"$work/packed.tar.gz"
    if [ "$(wc -c <"$work/packed.tar.gz")" -lt 16000000 ]; then break; fi
    largest=$(find "$dir" -type f -exec wc -c {} + | grep -v ' total$' | sort -rn | head -n 1 | sed 's/^ *[0-9]* //')
    note "left out: ${largest##*/}"
    rm -f "$largest"
  done
  mv "$work/packed.tar.gz" "$output/$1.tar.gz"
}

found_vendors=${OCL_ICD_VENDORS-} found_libraries=${LD_LIBRARY_PATH-}
name_driver
if [ -z "$device" ]; then
  if timeout -k 10 60 "$vsplat" devices --json 2>/dev/null | grep -q '"type": "gpu"'; then device=gpu; else say_no_device; fi
fi
failed=0
for step in ${steps:-$all_steps}; do
  dir=$work/$step notes=''
  rm -rf "$dir"
  mkdir -p "$dir"
  begun=$(now)
  step_end=$((begun + limit))
  code=0
  if [ -z "$device" ] && [ "$step" != doctor ]; then
    code=77
    note "no GPU among the devices; --device cpu tries a processor"
  elif [ $stopped = yes ]; then
    break
  else
    say "$step: at most $limit s"
    "step_$step" || code=$?
  fi
  case $code in
    0) result=ok ;;
    77)
      result=skipped
      notes=${notes:-vsplat has no such command, or it was not packed}
      if [ -z "$device" ]; then failed=1; fi
      ;;
    *)
      if [ "$(left)" -lt 1 ]; then result=late; else result=failed; fi
      failed=1
      ;;
  esac
  pack "$step"
  line=$(printf '%s\t%s\t%s s\t%s' "$step" "$result" "$(($(now) - begun))" "$notes")
  { grep -sv "^$step	" "$output/summary.txt" || :; printf '%s\n' "$line"; } >"$work/summary.txt"
  mv "$work/summary.txt" "$output/summary.txt"
  say "$line"
done
if [ $stopped = yes ]; then exit 130; fi
exit $failed
