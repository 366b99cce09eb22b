#!/usr/bin/env python3
"""Computes the weighted mean of models of one shape, as for the shipped model: models trained further from the same weights stay near each
other, and their mean is at least as good as the better one (README.md in this folder).

    model/weights/mean.py OUT.safetensors MODEL SHARE [MODEL SHARE ...] [--image N]

Values are summed in double and written as F32; shares are scaled to a sum of 1. Everything else in the file (configuration, step, ...) comes
from the first model, without its hash, which `vsplat weights convert` adds again. --image: the size that pictures are resampled to, which no
tensor's shape depends on. Needs numpy.
"""
import argparse
import json
import os
import struct
import sys

import numpy as np

DTYPES = {"F32": "<f4", "F16": "<f2"}


def read(path):
    """Returns the metadata, and each tensor as doubles."""
    with open(path, "rb") as f:
        header = json.loads(f.read(struct.unpack("<Q", f.read(8))[0]))
        data = f.read()
    metadata = header.pop("__metadata__", {})
    if metadata.get("format") != "vsplat-model":
        sys.exit(f"{path}: its format is {metadata.get('format')}, expected vsplat-model: a checkpoint's weights are in model.safetensors beside it")
    tensors = {}
    for name, about in header.items():
        begin, end = about["data_offsets"]
        tensors[name] = np.frombuffer(data[begin:end], DTYPES[about["dtype"]]).reshape(about["shape"]).astype("f8")
    return metadata, tensors


def write(path, metadata, tensors):
    header, values = {"__metadata__": metadata}, b""
    for name, tensor in tensors.items():
        begin = len(values)
        values += tensor.astype("<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [begin, len(values)]}
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path + ".part", "wb") as f:
        f.write(struct.pack("<Q", len(text)) + text + values)
    os.replace(path + ".part", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("models", nargs="+", metavar="MODEL SHARE")
    parser.add_argument("--image", type=int)
    o = parser.parse_args()
    if len(o.models) % 2:
        parser.error("a share after every model expected")
    paths = o.models[::2]
    try:
        shares = np.array([float(s) for s in o.models[1::2]])
    except ValueError:
        parser.error(f"a number as share after every model expected (found {' '.join(o.models[1::2])})")
    if not (np.isfinite(shares).all() and shares.sum() > 0):
        parser.error("shares with a sum above 0 expected")
    shares /= shares.sum()
    metadata, mean = None, {}
    for path, share in zip(paths, shares):
        own, tensors = read(path)
        if metadata is None:
            metadata, mean = own, {name: np.zeros_like(t) for name, t in tensors.items()}
        shapes, expected = ({n: t.shape for n, t in ts.items()} for ts in (tensors, mean))
        if shapes != expected:
            sys.exit(f"{path}: other tensors or shapes than {paths[0]} has: {sorted(set(shapes.items()) ^ set(expected.items()))[:2]}")
        for name in mean:
            mean[name] += share * tensors[name]
    metadata.pop("sha256", None)
    if o.image:
        metadata["config"] = json.dumps({**json.loads(metadata["config"]), "image": o.image})
    write(o.out, metadata, mean)


if __name__ == "__main__":
    main()
