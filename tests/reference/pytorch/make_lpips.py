#!/usr/bin/env python3
"""Golden distances of LPIPS, with weights that a formula makes on either side: real ones are not ours to give.

    make_lpips.py FILE        writes pictures and distances as safetensors

`numbers(seed, n)`: splitmix64 of seed * 2^32 + i, its upper 24 bits as a fraction. Seeds: convolution j has 2j (weights in
+-sqrt(6 / fan_in)) and 2j + 1 (biases in +-0.1), head k 100 + k (0 to 1), counted within each network; pictures 200 and up.
"""
import sys

import numpy as np
import torch
import torch.nn.functional as F

from safetensors_file import save_safetensors

ALEX = [(3, 64, 11, 4, 2, None), (64, 192, 5, 1, 2, 3), (192, 384, 3, 1, 1, 3), (384, 256, 3, 1, 1, None), (256, 256, 3, 1, 1, None)]
VGG = [(cin, cout, 3, 1, 1, 2 if pool else None) for cin, cout, pool in
       [(3, 64, 0), (64, 64, 0), (64, 128, 1), (128, 128, 0), (128, 256, 1), (256, 256, 0), (256, 256, 0), (256, 512, 1), (512, 512, 0),
        (512, 512, 0), (512, 512, 1), (512, 512, 0), (512, 512, 0)]]
COMPARED = {"alex": [0, 1, 2, 3, 4], "vgg": [1, 3, 6, 9, 12]}


def numbers(seed, n):
    with np.errstate(over="ignore"):
        z = (np.uint64(seed) << np.uint64(32)) + np.arange(n, dtype=np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(40)).astype(np.float64) / 2 ** 24


def uniform(seed, shape, bound):
    return torch.from_numpy(((numbers(seed, int(np.prod(shape))) * 2 - 1) * bound).astype(np.float32)).reshape(shape).double()


def distance(net, a, b):
    """(H,W,3) in [0,1] -> a number, as lpips.LPIPS(net=...)(2a - 1, 2b - 1) computes it."""
    layers = ALEX if net == "alex" else VGG
    shift, scale = torch.tensor([-0.030, -0.088, -0.188]).double(), torch.tensor([0.458, 0.448, 0.450]).double()
    x = torch.stack([(2 * p - 1 - shift) / scale for p in (a, b)]).permute(0, 3, 1, 2)
    total, head = 0, 0
    for j, (cin, cout, side, stride, pad, pool) in enumerate(layers):
        if pool:
            x = F.max_pool2d(x, pool, 2)
        weight = uniform(2 * j, (cout, cin, side, side), (6 / (cin * side * side)) ** 0.5)
        x = F.relu(F.conv2d(x, weight, uniform(2 * j + 1, (cout,), 0.1), stride=stride, padding=pad))
        if j in COMPARED[net]:
            unit = x / (x.pow(2).sum(1, keepdim=True).sqrt() + 1e-10)
            weight = torch.from_numpy(numbers(100 + head, cout).astype(np.float32)).double()
            total = total + ((unit[0] - unit[1]) ** 2 * weight[:, None, None]).sum(0).mean()
            head += 1
    return total


def main():
    torch.set_num_threads(1)
    out = {}
    for i, (height, width) in enumerate([(33, 47), (40, 71)]):
        count = height * width * 3
        a = torch.from_numpy(numbers(200 + 2 * i, count).astype(np.float32)).reshape(height, width, 3)
        b = (0.7 * a + 0.3 * torch.from_numpy(numbers(201 + 2 * i, count).astype(np.float32)).reshape(height, width, 3)).float()
        out[f"{i}.a"], out[f"{i}.b"] = a, b
        for net in ("alex", "vgg"):
            out[f"{i}.{net}"] = distance(net, a.double(), b.double()).reshape(1)
            print(i, net, float(out[f"{i}.{net}"]))
    save_safetensors(sys.argv[1], out)


if __name__ == "__main__":
    main()
