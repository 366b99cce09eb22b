#!/bin/sh
# Trains for a given time on the GPU of a machine that has only the GPU's driver: no network, no OpenCL loader, and no entry that names the
# driver to a loader. The bundle of cmake/bundle.sh contains everything needed; the script also runs from a build tree.
#
#   model/weights/train-on-a-gpu.sh --minutes M --output DIR [OPTION...]
#
#   --minutes M         total time, from the first check to the last file (a number, 0.5 is half a minute)
#   --output DIR        where the results go: at most eight files below 16 MiB each for a model of the shipped one's size
#   --from DIR          continues the training that an earlier call left there; may be the same folder
#   --config FILE       the configuration for vsplat train (gpu.json in this folder; with --from that training's)
#   --init FILE         the initial model (the built-in one); "none": random weights
#   --piece M           interrupts and resumes the training after so many minutes (8), and writes its results each time
#   --device NAME       as for vsplat (gpu: the first one); "cpu" tries the script out
#   --data DIR          a data set to train on, copied to the machine; again with --from
#   --draw N            first draws N random objects with all processors, and trains on them, so that the training need not wait for drawing;
#                       0 (the default): draws the configuration's share during the training
#   --textures DIR      pictures for the objects that are drawn during the training
#   --objects N         random objects for the measurement before and after (16)
#   --work DIR          where it works, and keeps the run (a temporary folder, which is removed)
#   --part-size KIB     size of the files that the training's state is cut into (16320)
#   --check-only        finds and checks the device, and stops
#
# The state is state-STEP.part-00 and so on; state.sha256 lists the parts (sha256sum -c), and is written last. The other files are
# model.safetensors, the averaged weights as F16; log.csv; sheet.png, the newest; summary.json. An interrupt or SIGTERM stops it with what is
# done by then. VSPLAT names the program if it is not beside this file. Exit codes: 0, 1 if something failed, 2 for wrong options.
set -eu
LC_ALL=C
export LC_ALL

# Results of PoCL 3.1 with both flavours of the kernels: the shipped model on two solids of seed 4711, white pictures, and a first training step
# from random weights. A device must come near to them. A new shipped model needs a new first number; one with another picture size also a
# new second one.
expected_psnr=24.93 expected_white=10.367 expected_loss=1.0084 expected_gradient=0.0834

say() { printf 'train-on-a-gpu: %s\n' "$*" >&2; }
fail() {
  say "$*"
  exit 1
}
usage() {
  say "$*; --help tells the options"
  exit 2
}
now() { date +%s; }
# seconds NAME MINUTES: a positive number of minutes in whole seconds
seconds() {
  case $2 in '' | *[!0-9.]* | *.*.*) usage "$1 is \"$2\": a number of minutes expected" ;; esac
  awk -v m="$2" 'BEGIN { s = int(m * 60 + 0.5); exit s < 1 ? 1 : 0 }' || usage "$1 is \"$2\": at least a second expected"
  awk -v m="$2" 'BEGIN { print int(m * 60 + 0.5) }'
}
count() { case $2 in '' | *[!0-9]*) usage "$1 is \"$2\": a whole number expected" ;; esac; }
# near FOUND EXPECTED MOST: whether they differ by at most MOST
near() { awk -v a="$1" -v b="$2" -v d="$3" 'BEGIN { exit (a == "" || a - b > d || b - a > d) ? 1 : 0 }'; }
mean() { sed -n '/"mean"/,$p' "$1" | field "$2"; }

minutes='' output='' from='' config='' init='' piece=8 device='' data='' draw='' textures='' objects=16 work='' part_size=16320 check_only=no
while [ $# -gt 0 ]; do
  case $1 in
    -h | --help)
      sed -n '2,/^set -eu/{/^set -eu/d;s/^# \{0,1\}//;p;}' "$0"
      exit 0
      ;;
    --check-only) check_only=yes ;;
    --minutes | --output | --from | --config | --init | --piece | --device | --data | --draw | --textures | --objects | --work | --part-size)
      [ $# -gt 1 ] || usage "$1 needs a value"
      case $1 in
        --minutes) minutes=$2 ;;
        --output) output=$2 ;;
        --from) from=$2 ;;
        --config) config=$2 ;;
        --init) init=$2 ;;
        --piece) piece=$2 ;;
        --device) device=$2 ;;
        --data) data=$2 ;;
        --draw) draw=$2 ;;
        --textures) textures=$2 ;;
        --objects) objects=$2 ;;
        --work) work=$2 ;;
        --part-size) part_size=$2 ;;
      esac
      shift
      ;;
    *) usage "$1 is no option" ;;
  esac
  shift
done
begun=$(now)
if [ $check_only = no ]; then
  [ -n "$minutes" ] || usage "--minutes is missing"
  [ -n "$output" ] || usage "--output is missing"
  time=$(seconds --minutes "$minutes")
  piece_time=$(seconds --piece "$piece")
  end=$((begun + time))
fi
count --objects "$objects"
count --part-size "$part_size"
if [ "$objects" -eq 0 ] || [ "$part_size" -eq 0 ]; then usage "--objects and --part-size are at least 1"; fi
[ -z "$draw" ] || count --draw "$draw"

here=$(cd "$(dirname "$0")" && pwd)
top=$here/../..
. "$top/bench/gpu-driver.sh"
find_vsplat

if [ -z "$work" ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
else
  mkdir -p "$work"
  work=$(cd "$work" && pwd)
fi
# An interrupt from the terminal reaches the training directly; a signal to this script alone is forwarded.
child='' stopped=no
trap 'stopped=yes; [ -n "$child" ] || exit 130' INT
trap 'stopped=yes; [ -n "$child" ] || exit 143; kill -INT "$child" 2>/dev/null || :' TERM HUP
: "${HOME:=$work}" "${VSPLAT_CACHE_DIR:=$work/cache}"
export HOME VSPLAT_CACHE_DIR

name_driver
no_device() {
  say_no_device
  fail "$*"
}
"$vsplat" devices --json >"$work/devices.json" 2>"$work/devices.err" || no_device "no OpenCL device: $(head -n 1 "$work/devices.err")"
"$vsplat" devices 2>&1 | sed 's/^/train-on-a-gpu:   /' >&2
if [ -z "$device" ]; then
  grep -q '"type": "gpu"' "$work/devices.json" || no_device "no GPU is among the OpenCL devices; --device cpu takes a processor all the same"
  device=gpu
fi

# --- Checks that the device computes correctly, so that a wrong driver is reported before it costs time. Known answers, and the same bits twice.
rm -rf "$work/check"
mkdir -p "$work/check"
"$vsplat" dataset procedural --count 2 --solids --views 12 --size 64 --seed 4711 --output "$work/check/set" --quiet ||
  fail "the objects of the check could not be drawn: see above"
for i in 1 2; do
  "$vsplat" evaluate "$work/check/set" --device "$device" --json >"$work/check/evaluation-$i.json" 2>"$work/check/err" || {
    cat "$work/check/err" >&2
    fail "the check's reconstructions failed on this device: see above"
  }
done
device_line=$(sed -n 's/^device //p' "$work/check/err" | head -n 1)
say "device $device_line"
cat >"$work/check/train.json" <<'END'
{"model": "micro", "seed": 5, "steps": 8, "procedural": 1, "lr": 0.001, "warmup": 2, "batch": 2, "log_every": 1, "sheet_every": 0,
 "checkpoint_every": 0}
END
for i in 1 2; do
  "$vsplat" train "$work/check/train.json" --device "$device" --output "$work/check/run-$i" --quiet || fail "the check's training failed on this device"
done
psnr=$(mean "$work/check/evaluation-1.json" psnr)
white=$(mean "$work/check/evaluation-1.json" psnr_white)
loss=$(sed -n 2p "$work/check/run-1/log.csv" | cut -d, -f5)
gradient=$(sed -n 2p "$work/check/run-1/log.csv" | cut -d, -f11)
say "check: PSNR $psnr dB (expected $expected_psnr), of white $white ($expected_white), loss $loss ($expected_loss), gradient $gradient ($expected_gradient)"
near "$white" "$expected_white" 0.1 || fail "the objects of the check look different here: white is $white dB from them, $expected_white expected"
near "$psnr" "$expected_psnr" 0.3 ||
  fail "this device reconstructs wrongly: PSNR $psnr dB, $expected_psnr expected. Another driver, or --device, may do (or the shipped model is a new one, and this script has the old one's number)"
near "$loss" "$expected_loss" 0.03 || fail "this device trains wrongly: a first loss of $loss, $expected_loss expected; another driver may do"
near "$gradient" "$expected_gradient" 0.01 || fail "this device's gradients are wrong: a norm of $gradient, $expected_gradient expected; another driver may do"
cmp -s "$work/check/evaluation-1.json" "$work/check/evaluation-2.json" || fail "this device gave other numbers for the same reconstructions"
cmp -s "$work/check/run-1/model.safetensors" "$work/check/run-2/model.safetensors" || fail "this device gave other weights for the same training"
say "check: right, and twice the same bits ($(($(now) - begun)) s)"
if [ $check_only = yes ]; then exit 0; fi

# --- The run: a new one, or the one that an earlier call has left. Its folder holds config.json, which says what is trained.
run=$work/run
first_psnr=null earlier_seconds=0 calls=0
if [ -n "$from" ]; then
  from=$(cd "$from" && pwd) || exit 1
  [ -f "$from/state.sha256" ] || fail "$from/state.sha256 is missing: no training was left there, or not to the end"
  # (The weights beside the state may be missing.)
  (cd "$from" && grep '[ *]state-' state.sha256 | sha256sum -c --quiet) >&2 || fail "$from: a part of the state is missing or damaged: see above; nothing was trained"
  rm -rf "$run"
  sed -n 's/^[0-9a-f]* [ *]\(state-.*\)$/\1/p' "$from/state.sha256" | sort >"$work/parts"
  while read -r part; do cat "$from/$part"; done <"$work/parts" | tar -C "$work" -xf - || fail "$from: the state could not be unpacked"
  if [ ! -f "$work/run.json" ] || [ ! -d "$run" ]; then fail "$from: the state holds no training"; fi
  first_psnr=$(field psnr_first <"$work/summary.json")
  earlier_seconds=$(field training_seconds <"$work/summary.json")
  calls=$(field calls <"$work/summary.json")
  kept_draw=$(field drawn <"$work/summary.json")
  : "${draw:=$kept_draw}"
  [ "$draw" = "$kept_draw" ] || usage "--draw is $draw, but the training in $from was begun with $kept_draw"
  if [ -n "$config" ]; then cp "$config" "$work/run.json"; fi
else
  rm -rf "$run"
  cp "${config:-$here/gpu.json}" "$work/run.json"
  : "${draw:=0}"
fi
"$vsplat" train "$work/run.json" --print-config >"$work/full.json" || fail "the configuration is refused: see above"
# The value in the last stage, if there are stages.
last() { sed -n "s/^.*\"$1\": *\([0-9]*\).*$/\1/p" "$work/full.json" | tail -n 1; }
size=$(last image) batch=$(last batch) accumulate=$(last accumulate)
all_steps=$(sed -n 's/^.*"steps": *\([0-9]*\).*$/\1/p' "$work/full.json" | awk '{ n += $1 } END { print n }')

# draw_objects: draws the training's own data set, by eight processes with separate objects and folders. The bytes are always the same.
draw_objects() {
  drawers=8 # fixed, since it determines the objects
  each=$(((draw + drawers - 1) / drawers))
  rm -rf "$work/drawn"
  mkdir -p "$work/drawn"
  drawing=''
  for i in $(seq 1 $drawers); do
    "$vsplat" dataset procedural --count "$each" --views 24 --size "$size" --seed $((1000 + i)) ${textures:+--textures "$textures"} \
      --output "$work/drawn/$i" --quiet &
    drawing="$drawing $!"
  done
  for process in $drawing; do wait "$process" || fail "the objects to train on could not be drawn: see above"; done
}
set --
if [ "$draw" -gt 0 ]; then
  draw_begun=$(now)
  draw_objects
  set -- --data "$work/drawn"
  say "$((each * drawers)) objects drawn in $(($(now) - draw_begun)) s"
  # A tenth of a step's objects is still generated during training.
  if [ -z "$from" ]; then sed -i 's/"procedural": *[0-9.]*/"procedural": 0.1/' "$work/run.json"; fi
fi
if [ -n "$data" ]; then
  if [ $# -gt 0 ]; then set -- "$@" "$data"; else set -- --data "$data"; fi
fi
if [ -n "$textures" ]; then set -- "$@" --textures "$textures"; fi
case $init in
  none) ;;
  '')
    # (Where the model inside does not fit the configuration, training says which field differs.)
    rm -f "$work/begin.safetensors"
    "$vsplat" weights convert --dtype f16 --output "$work/begin.safetensors" --quiet || fail "vsplat has no model inside: --init names one, or none"
    init=$work/begin.safetensors
    ;;
esac
if [ "$init" != none ]; then set -- "$@" --init "$init"; fi

# newest FOLDER: its checkpoint with the highest step, or nothing
newest() { find "$1" -maxdepth 1 -name 'checkpoint-*.safetensors' 2>/dev/null | sort | tail -n 1; }
# Steps done, over all stages.
steps_done() {
  sum=0
  for folder in "$run" "$run"/stage-*; do
    file=$(newest "$folder")
    number=$(basename "${file:-checkpoint-0.safetensors}" .safetensors | sed 's/checkpoint-0*//')
    sum=$((sum + ${number:-0}))
  done
  echo $sum
}
# psnr_of NAME MODEL: writes evaluation-NAME.json, prints the mean PSNR on objects that no training sees
psnr_of() {
  "$vsplat" evaluate "$work/held-out" --model "$2" --device "$device" --size "$size" --json >"$work/evaluation-$1.json" 2>"$work/evaluate.err" || {
    cat "$work/evaluate.err" >&2
    echo null
    return
  }
  mean "$work/evaluation-$1.json" psnr
}
rm -rf "$work/held-out"
"$vsplat" dataset procedural --count "$objects" --views 24 --size "$size" --seed 20011 --output "$work/held-out" --quiet ||
  fail "the objects to measure on could not be drawn: see above"

# summary: what was done, for a reader and for the next call
psnr_after=null trained=0 result=0
start_steps=0 rate=0
summary() {
  done_steps=$(steps_done)
  rate=$(awk -v n=$((done_steps - start_steps)) -v s="$trained" 'BEGIN { printf "%.3f", (s > 0 ? n / s : 0) }')
  cat >"$work/summary.json" <<END
{
 "device": "$(printf '%s' "$device_line" | tr -d '"\134')",
 "driver": "$(printf '%s' "${driver:-$vendors}" | tr -d '"\134')",
 "vsplat": "$(printf '%s' "$version" | tr -d '"\134')",
 "calls": $calls,
 "steps": $done_steps,
 "steps_of": $all_steps,
 "steps_here": $((done_steps - start_steps)),
 "steps_per_second": $rate,
 "objects_per_second": $(awk -v r="$rate" -v b=$((batch * accumulate)) 'BEGIN { printf "%.3f", r * b }'),
 "training_seconds": $((earlier_seconds + trained)),
 "training_seconds_here": $trained,
 "drawn": $draw,
 "held_out_objects": $objects,
 "psnr_first": $first_psnr,
 "psnr_before": $psnr_before,
 "psnr_after": $psnr_after,
 "failed": $result
}
END
}
# put FILE...: copies files to the output's folder, each whole or not at all
put() {
  for file in "$@"; do
    cp "$file" "$output/.new"
    mv "$output/.new" "$output/$(basename "$file")"
  done
}

# pack: writes the state and all results to the output's folder. The state's list is written last and names the parts; then old parts are
# removed, so that a call that is killed in between leaves one complete state.
pack() {
  summary
  rm -rf "$work/packed"
  mkdir -p "$work/packed" "$output"
  # Only the newest checkpoint and sheet of each stage.
  (
    cd "$work"
    echo run.json
    echo summary.json
    if [ -d cache ] && [ "$(du -sk cache | cut -f1)" -le 4096 ]; then echo cache; fi
    for folder in run run/stage-*; do
      for file in "$folder/config.json" "$folder/log.csv"; do
        if [ -f "$file" ]; then echo "$file"; fi
      done
      newest "$folder"
      find "$folder/sheets" -name 'step-*.png' 2>/dev/null | sort | tail -n 1
    done
    # The next stage begins with a stage's weights; those of the last stage are also in the checkpoint.
    stage=$(find run -maxdepth 1 -name 'stage-*' 2>/dev/null | sort | tail -n 1)
    if [ -n "$stage" ] && [ -f "$stage/model.safetensors" ]; then echo "$stage/model.safetensors"; fi
  ) >"$work/list"
  tar -C "$work" -cf "$work/state.tar" -T "$work/list"
  split -b "${part_size}k" -d "$work/state.tar" "$work/packed/state-$(printf %08d "$done_steps").part-"
  rm -f "$work/state.tar"
  model=$run/model.safetensors
  if [ -f "$model" ]; then # (there is one beside each checkpoint)
    "$vsplat" weights convert "$model" --dtype f16 --output "$work/packed/model.safetensors" --quiet || say "the weights could not be written as F16"
  fi
  # (If larger than a part: cut like the state, and listed with it.)
  if [ -f "$work/packed/model.safetensors" ] && [ "$(wc -c <"$work/packed/model.safetensors")" -gt $((part_size * 1024)) ]; then
    split -b "${part_size}k" -d "$work/packed/model.safetensors" "$work/packed/model.safetensors.part-"
    rm "$work/packed/model.safetensors"
  fi
  folder=$run
  for stage in "$run"/stage-*; do if [ -f "$stage/log.csv" ]; then folder=$stage; fi; done
  if [ -f "$folder/log.csv" ]; then cp "$folder/log.csv" "$work/packed/log.csv"; fi
  sheet=$(find "$folder/sheets" -name 'step-*.png' 2>/dev/null | sort | tail -n 1)
  if [ -n "$sheet" ]; then cp "$sheet" "$work/packed/sheet.png"; fi
  (cd "$work/packed" && find . -name 'state-*' -o -name 'model.safetensors*' | sed 's|^./||' | sort | xargs sha256sum) >"$work/state.sha256"
  put "$work/packed"/* "$work/state.sha256" "$work/summary.json"
  for file in "$output"/state-*.part-* "$output"/model.safetensors*; do
    if [ -e "$file" ] && [ ! -e "$work/packed/$(basename "$file")" ]; then rm -f "$file"; fi
  done
  rm -rf "$work/packed"
}

measuring=$(now)
if [ -n "$from" ] && [ -f "$from/model.safetensors" ]; then
  psnr_before=$(psnr_of before "$from/model.safetensors")
elif [ -n "$from" ]; then
  psnr_before=$(field psnr_after <"$work/summary.json")
elif [ "$init" != none ]; then
  psnr_before=$(psnr_of before "$init")
else
  psnr_before=null
fi
[ -n "$first_psnr" ] && [ "$first_psnr" != null ] || first_psnr=$psnr_before
# Reserved for the end: another such measurement, and writing the results.
measuring=$(($(now) - measuring))
reserve=$((measuring + 2))
if [ "$psnr_before" = null ] && [ $reserve -lt $((time / 20)) ]; then reserve=$((time / 20)); fi
start_steps=$(steps_done)
calls=$((calls + 1))
say "PSNR on $objects objects that are not trained on: $psnr_before dB; at step $start_steps of $all_steps, $((end - $(now))) s left, $reserve of them for the end"

# --- Pieces of equal length. A failed piece is tried again once, from the last checkpoint.
failures=0 pieces=0
while [ $stopped = no ]; do
  left=$((end - reserve - $(now)))
  if [ $left -lt 1 ]; then break; fi
  length=$((left / ((left + piece_time - 1) / piece_time)))
  piece_begun=$(now)
  "$vsplat" train "$work/run.json" "$@" --device "$device" --output "$run" --resume &
  child=$!
  pieces=$((pieces + 1))
  asked=no
  while kill -0 $child 2>/dev/null; do
    taken=$(($(now) - piece_begun))
    if [ $asked = no ] && { [ $taken -ge $length ] || [ $stopped = yes ]; }; then
      if [ $stopped = no ]; then kill -INT $child 2>/dev/null || :; fi
      asked=$taken
    elif [ $asked != no ] && [ $taken -ge $((asked + 120)) ]; then
      say "the training does not stop: it is killed"
      kill -KILL $child 2>/dev/null || :
    fi
    sleep 1
  done
  code=0
  wait $child || code=$?
  child=
  trained=$((trained + $(now) - piece_begun))
  case $code in
    0 | 130) failures=0 ;;
    *)
      failures=$((failures + 1))
      say "the training ended with exit code $code"
      ;;
  esac
  if [ -n "$(newest "$run")$(newest "$run/stage-1")" ]; then pack; else say "no checkpoint is there to be kept"; fi
  say "step $done_steps of $all_steps, $rate steps/s in $trained s of training here; written into $output"
  if [ $code -eq 0 ]; then break; fi
  if [ $failures -gt 1 ]; then
    result=1
    say "it failed twice: what was reached by then is in $output"
    break
  fi
done
if [ $pieces -eq 0 ] && [ $stopped = no ]; then
  result=1
  say "$minutes minutes leave no time to train: what comes before and after takes $(($(now) - begun + reserve)) s here"
fi
if [ $pieces -gt 0 ] && [ $stopped = no ] && [ -f "$run/model.safetensors" ]; then
  # Measured with the weights that are written, so that the next call finds the same value.
  if [ -f "$output/model.safetensors" ]; then psnr_after=$(psnr_of after "$output/model.safetensors"); else psnr_after=$(psnr_of after "$run/model.safetensors"); fi
fi
mkdir -p "$output"
summary
put "$work/summary.json"
say "PSNR $psnr_before dB before, $psnr_after dB after; step $done_steps of $all_steps, $rate steps/s; $(find "$output" -type f | wc -l) files,\
 the largest of $(find "$output" -type f -exec du -k {} + | sort -rn | head -n 1 | cut -f1) KiB; $(($(now) - begun)) s in all"
exit $result
