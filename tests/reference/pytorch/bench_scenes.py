"""Write the two scenes that rendering is timed on, as standard 3DGS PLY files with their cameras.

    python3 bench_scenes.py FOLDER

object-190k   188,003 Gaussians in the object's cube, as the paper-size network makes them: 17 in each of
              the 11,059 of 48^3 voxels nearest to a sphere; SH degree 1; 8 cameras at 512 x 512
slab-1m       1,000,000 Gaussians over a hilly ground of 8 x 8 with boxes on it, sizes log-normal as in
              captured scenes (a few large ones, many small); SH degree 3; 8 cameras at 1280 x 720

Each comes as NAME.ply and NAME.cameras.json (OpenCV axes, w2c, pixel centres at +0.5). The same every time.
"""
import json
import math
import os
import sys

import numpy as np

RNG = np.random.default_rng


def write_ply(path, means, scales, quats, opacities, sh):
    """means (K,3), scales (K,3) linear, quats (K,4) wxyz, opacities (K,) in (0,1), sh (K,S,3)."""
    k, s, _ = sh.shape
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{i}" for i in range(3 * (s - 1))] + ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    rest = sh[:, 1:].transpose(0, 2, 1).reshape(k, 3 * (s - 1))              # channel-major
    table = np.concatenate([means, np.zeros((k, 3)), sh[:, 0], rest, np.log(opacities / (1 - opacities))[:, None],
                            np.log(scales), quats], 1).astype("<f4")
    with open(path, "wb") as f:
        f.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % k
                 + "".join(f"property float {n}\n" for n in names) + "end_header\n").encode())
        f.write(table.tobytes())


def look_at(eye, target, up):
    f = (target - eye) / np.linalg.norm(target - eye)
    r = np.cross(f, up)
    r /= np.linalg.norm(r)
    w2c = np.eye(4)
    w2c[:3, :3] = np.stack([r, np.cross(f, r), f])
    w2c[:3, 3] = -w2c[:3, :3] @ eye
    return w2c


def write_cameras(path, eyes, target, up, width, height, fov_deg):
    focal = 0.5 * width / math.tan(math.radians(fov_deg) / 2)
    cams = [{"file": f"{i:04d}.png", "w": width, "h": height, "fx": focal, "fy": focal, "cx": width / 2, "cy": height / 2,
             "w2c": look_at(np.array(e, float), np.array(target, float), np.array(up, float)).tolist()} for i, e in enumerate(eyes)]
    with open(path, "w") as f:
        json.dump(cams, f, indent=1)


def unit(q):
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def object_190k(folder):
    rng, R, M = RNG(190), 48, 17
    a = (np.arange(R) + 0.5) / R - 0.5
    centres = np.stack(np.meshgrid(a, a, a, indexing="ij"), -1).reshape(-1, 3)
    order = np.argsort(np.abs(np.linalg.norm(centres, axis=1) - 0.3), kind="stable")
    c = np.repeat(centres[np.sort(order[: R ** 3 // 10])], M, 0)
    k = len(c)
    means = c + rng.uniform(-0.375, 0.375, (k, 3)) / R
    scales = np.exp(rng.normal(np.log(1 / (6 * R)), 0.5, (k, 3)))
    opacities = 1 / (1 + np.exp(-rng.normal(0.5, 2.0, k)))
    sh = np.zeros((k, 4, 3))
    check = (np.floor(means * 8).sum(1) % 2)[:, None]
    sh[:, 0] = (np.where(check > 0, [0.9, 0.3, 0.2], [0.2, 0.4, 0.9]) - 0.5) / 0.28209479177387814
    sh[:, 1:] = rng.normal(0, 0.05, (k, 3, 3))
    write_ply(f"{folder}/object-190k.ply", means, scales, unit(rng.normal(size=(k, 4))), np.clip(opacities, 1e-4, 1 - 1e-4), sh)
    eyes = [(1.6 * math.cos(0.3) * math.sin(t), -1.6 * math.sin(0.3), -1.6 * math.cos(0.3) * math.cos(t)) for t in np.arange(8) * math.pi / 4]
    write_cameras(f"{folder}/object-190k.cameras.json", eyes, (0, 0, 0), (0, -1, 0), 512, 512, 50)


def slab_1m(folder):
    rng, k = RNG(1000), 1_000_000
    xy = rng.uniform(-4, 4, (k, 2))
    h = 0.3 * np.sin(1.3 * xy[:, 0]) * np.cos(1.7 * xy[:, 1])
    boxes = rng.uniform(-3.5, 3.5, (40, 2))
    size = rng.uniform(0.15, 0.5, (40, 3))
    pick = rng.random(k) < 0.5                                               # half of them on the boxes' walls
    b = rng.integers(0, 40, k)
    face = rng.integers(0, 3, k)
    u = rng.uniform(-1, 1, (k, 3))
    u[np.arange(k), face] = np.sign(u[np.arange(k), face])
    wall = np.concatenate([boxes[b], np.zeros((k, 1))], 1) + u * size[b] + [0, 0, 0.4]
    means = np.where(pick[:, None], wall, np.concatenate([xy, h[:, None]], 1))
    scales = np.exp(rng.normal(-4.6, 0.7, (k, 1)) + rng.normal(0, 0.5, (k, 3)))
    opacities = 1 / (1 + np.exp(-rng.normal(0.5, 2.5, k)))
    sh = np.zeros((k, 16, 3))
    sh[:, 0] = (0.5 + 0.4 * np.sin(means * [3, 5, 7] + [0, 1, 2]) - 0.5) / 0.28209479177387814
    sh[:, 1:] = rng.normal(0, 0.03, (k, 15, 3))
    write_ply(f"{folder}/slab-1m.ply", means, scales, unit(rng.normal(size=(k, 4))), np.clip(opacities, 1e-4, 1 - 1e-4), sh)
    eyes = [(5 * math.cos(t), 5 * math.sin(t), 2.5) for t in np.arange(8) * math.pi / 4]
    write_cameras(f"{folder}/slab-1m.cameras.json", eyes, (0, 0, 0.2), (0, 0, 1), 1280, 720, 60)


if __name__ == "__main__":
    out = sys.argv[1]
    os.makedirs(out, exist_ok=True)
    object_190k(out)
    slab_1m(out)
