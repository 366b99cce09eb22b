#!/usr/bin/env python3
"""Trains the paper's ablations at a small scale, the same number of steps each, and evaluates them on objects set aside.

    bench/paper_comparison.py --vsplat build/release/bin/vsplat --data TRAIN... --test TEST... --output DIR [--steps 2000] [--only NAME...]

The configuration is model/weights/train.json's, shortened. A training that was interrupted goes on where it was; one that is done is not
run again. The table (Markdown) goes to standard output and to DIR/table.md.
"""
import json

import training

# The paper's names of tables II and A.I, and what changes.
VARIANTS = {
    "coarse": ("coarse level only", {"levels": "coarse"}),
    "skeletal": ("skeletal only", {"levels": "skeletal"}),
    "unprojected": ("without projected features", {"use_projected": False}),
    "m1": ("M = 1", {"fine_count": 1}),
    "m4": ("M = 4", {"fine_count": 4}),
    "default": ("default, gumbel", {}),
    "sigmoid": ("selection by sigmoid", {"selection": "sigmoid"}),
    "ste": ("selection by ste", {"selection": "ste"}),
    "opacity": ("selection by opacity", {"selection": "opacity"}),
}
COLUMNS = ("psnr", "psnr_coarse", "ssim", "selected")


def configuration(base, fields, steps):
    config = json.loads(json.dumps(base))
    share = steps / config["steps"]
    config["model"].update(fields)
    config.update(steps=steps, warmup=max(1, round(config["warmup"] * share)), tau_steps=max(1, round(config["tau_steps"] * share)),
                  sheet_every=0, checkpoint_every=max(1, steps // 4), keep_checkpoints=1)
    return config


def main():
    ap = training.parser(__doc__)
    ap.add_argument("--data", nargs="+", required=True)
    ap.add_argument("--test", nargs="+", required=True)
    ap.add_argument("--steps", type=int, default=2000)
    ap.add_argument("--only", nargs="+", choices=sorted(VARIANTS), default=list(VARIANTS))
    a = ap.parse_args()
    base = json.loads(a.config.read_text())
    a.output.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in a.only:
        words, fields = VARIANTS[name]
        folder, result = a.output / name, a.output / f"{name}.json"
        if not result.exists():
            config = a.output / f"{name}-config.json"
            config.write_text(json.dumps(configuration(base, fields, a.steps), indent=1) + "\n")
            resume = ["--resume"] if list(folder.glob("checkpoint-*.safetensors")) else []
            training.run([a.vsplat, "train", config, "--data", *a.data, "--output", folder, *resume])
            scores = training.run([a.vsplat, "evaluate", *a.test, "--model", folder / "model.safetensors", "--json"])
            result.write_text(scores)
        mean = json.loads(result.read_text())["mean"]
        rows.append([words] + [f"{mean[c]:.3f}" for c in COLUMNS])
    table = "\n".join(["| variant | " + " | ".join(COLUMNS) + " |", "| --- |" + " ---: |" * len(COLUMNS)]
                      + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"
    (a.output / "table.md").write_text(table)
    print(table, end="")


if __name__ == "__main__":
    main()
