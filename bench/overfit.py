#!/usr/bin/env python3
"""Trains the shipped model's sizes on the views of a few objects, from nothing, until it knows them by heart: what the method and its
optimisation can reach when nothing has to be guessed.

    bench/overfit.py --vsplat build/release/bin/vsplat --output DIR MESH... [--views 8] [--set FIELD=VALUE ...]

Every object is drawn from a few directions; each step takes four of them as input and four others as novel views, in another order
each time. The mean of each level over the objects goes to standard output, as `vsplat evaluate --json` has it; the log is in DIR/run.
"""
import json

import training


def configuration(base, fields):
    """What trains one object in 1700 steps, with `fields` ("model.image=48") changed."""
    config = {"model": dict(base["model"]), "seed": base["seed"], "steps": 1700, "lr": 0.002, "warmup": 50, "tau_steps": 200,
              "random_background": False, "log_every": 50, "sheet_every": 0, "checkpoint_every": 500, "keep_checkpoints": 1}
    for field in fields:
        name, value = field.split("=", 1)
        *parents, name = name.split(".")
        (config[parents[0]] if parents else config)[name] = json.loads(value)
    return config


def main():
    ap = training.parser(__doc__)
    ap.add_argument("meshes", nargs="+", metavar="MESH")
    ap.add_argument("--views", type=int, default=8)
    ap.add_argument("--set", nargs="+", default=[], metavar="FIELD=VALUE", help="of the training's configuration, the model's as model.FIELD")
    a = ap.parse_args()
    a.output.mkdir(parents=True)
    views, config, trained = a.output / "views", a.output / "config.json", a.output / "run"
    config.write_text(json.dumps(configuration(json.loads(a.config.read_text()), a.set), indent=1) + "\n")
    training.run([a.vsplat, "dataset", "render", *a.meshes, "--views", str(a.views), "--size", "128", "--seed", "1", "--output", views])
    training.run([a.vsplat, "train", config, "--data", views, "--output", trained])
    scores = json.loads(training.run([a.vsplat, "evaluate", views, "--model", trained / "model.safetensors", "--json"]))
    print(json.dumps(scores["mean"], indent=1))


if __name__ == "__main__":
    main()
