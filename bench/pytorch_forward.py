#!/usr/bin/env python3
"""Times a forward of the network in PyTorch on the processor, as `vsplat bench model --references` asks for it.

    bench/pytorch_forward.py SIZE THREADS [SECONDS]

SIZE is paper, small or tiny. Weights are random, and the selected voxels are the tenth that is nearest a sphere, as in `vsplat bench model`.
Prints one line of JSON: the version of PyTorch, and the median seconds in fp32 and with autocast to bf16, of as many runs as take SECONDS
(1), at least one after the first.
"""
import dataclasses
import json
import pathlib
import statistics
import sys
import time
import warnings

import torch

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "reference" / "pytorch"))
from object_views import checked_ball, orbit_cameras  # noqa: E402
from vsplat_config import CONFIGS  # noqa: E402
import vsplat_reference as reference  # noqa: E402

VIEWS = 4


def shell(cfg, share):
    """The voxels nearest a sphere of radius 0.3, ascending."""
    away = (reference.voxel_centres(cfg.volume, torch.zeros(1)).norm(dim=1) - 0.3).abs()
    return away.argsort(stable=True)[:int(share * cfg.volume ** 3)].sort()[0]


def in_full_precision(function):
    """Rays, projections, samples and group norms stay in fp32, as they would in a network that trains with autocast."""
    def run(*arguments):
        with torch.autocast("cpu", enabled=False):
            return function(*[a.float() if torch.is_tensor(a) and a.dtype == torch.bfloat16 else a for a in arguments])
    return run


def median_seconds(forward, seconds):
    times = []
    while len(times) < 2 or (sum(times) < seconds and len(times) < 100):
        begun = time.perf_counter()
        with torch.no_grad():
            forward()
        times.append(time.perf_counter() - begun)
    return statistics.median(times[1:])  # the first one also makes primitives


def main():
    size, threads = sys.argv[1], int(sys.argv[2])
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 1.0
    warnings.simplefilter("ignore")
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    cfg = dataclasses.replace(CONFIGS[size], views=VIEWS)
    model, selection = reference.VSplat(cfg).eval(), shell(cfg, 0.1)
    c2w, K = orbit_cameras(cfg.views, cfg)
    images = checked_ball(c2w, K, cfg.image)

    for where, name in ((reference, "plucker"), (reference, "lift"), (reference, "sample_views"), (torch.nn.functional, "group_norm")):
        setattr(where, name, in_full_precision(getattr(where, name)))

    def forward():
        model(images, c2w, K, selection=selection)

    out = {"version": torch.__version__, "fp32": median_seconds(forward, seconds)}
    with torch.autocast("cpu", dtype=torch.bfloat16):
        out["bf16"] = median_seconds(forward, seconds)
    print(json.dumps(out))


if __name__ == "__main__":
    main()
