#!/usr/bin/env python3
"""Trains the shipped model's sizes on the views of a few objects, from nothing, until it knows them by heart: what the method and its
optimisation can reach when nothing has to be guessed.

    bench/overfit.py --vsplat build/release/bin/vsplat --output DIR MESH... [--views 8] [--steps 1700]

Every object is drawn from a few directions; each step takes four of them as input and four others as novel views, in another order
each time. The mean of each level over the objects goes to standard output, as `vsplat evaluate --json` has it; the log is in DIR/run.
"""
import argparse
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def configuration(base, steps):
    return {"model": base["model"], "seed": base["seed"], "steps": steps, "lr": 0.002, "warmup": min(50, steps), "tau_steps": max(1, steps // 6),
            "random_background": False, "log_every": 50, "sheet_every": 0, "checkpoint_every": 500, "keep_checkpoints": 1}


def run(command):
    print("+", " ".join(map(str, command)), file=sys.stderr, flush=True)
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("meshes", nargs="+", metavar="MESH")
    ap.add_argument("--vsplat", default="vsplat")
    ap.add_argument("--output", type=pathlib.Path, required=True)
    ap.add_argument("--config", type=pathlib.Path, default=ROOT / "model/weights/train.json")
    ap.add_argument("--views", type=int, default=8)
    ap.add_argument("--steps", type=int, default=1700)
    a = ap.parse_args()
    a.output.mkdir(parents=True)
    views, config, trained = a.output / "views", a.output / "config.json", a.output / "run"
    config.write_text(json.dumps(configuration(json.loads(a.config.read_text()), a.steps), indent=1) + "\n")
    run([a.vsplat, "dataset", "render", *a.meshes, "--views", str(a.views), "--size", "128", "--seed", "1", "--output", views])
    run([a.vsplat, "train", config, "--data", views, "--output", trained])
    scores = json.loads(run([a.vsplat, "evaluate", views, "--model", trained / "model.safetensors", "--json"]))
    print(json.dumps(scores["mean"], indent=1))


if __name__ == "__main__":
    main()
