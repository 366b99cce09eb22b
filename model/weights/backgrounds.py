#!/usr/bin/env python3
"""Objects of a data set before a background, as photographs without masks show them: a room about each, and under it a table.

    model/weights/backgrounds.py SET OUT PATTERNS [--every N] [--seed S]

SET is a folder of folders as `vsplat dataset render` writes them (y up, RGBA with straight alpha); every N-th of its objects by name
goes to OUT with RGB pictures of the same size and the same cameras. Walls and table have a colour or one of the pictures of PATTERNS each;
the table hides nothing from cameras below it. Same arguments, same bytes. Needs numpy and Pillow.
"""
import argparse
import json
import math
import pathlib
import random

import numpy as np
from PIL import Image, ImageFilter


def surface(rng, patterns):
    """A function from coordinates [n, 2] in the world's unit (about the object's size) to colours [n, 3] of 0 to 255."""
    colour = np.array([rng.uniform(20, 235) for _ in range(3)])
    if rng.random() < 0.4:
        return lambda uv: np.broadcast_to(colour, (len(uv), 3))
    picture = Image.open(rng.choice(patterns)).convert("RGB").resize((256, 256), Image.BOX)
    picture = np.asarray(picture.filter(ImageFilter.GaussianBlur(rng.choice([0, 2, 8])))).astype("f8")
    picture = picture + rng.uniform(0, 0.8) * (colour - picture)
    scale = 256 / rng.uniform(0.7, 4)

    def at(uv):
        u, v = np.floor(uv * scale).astype(int).T % 256
        return picture[v, u]
    return at


def background(camera, width, height, focal, room, walls, table, top, reach):
    """What is seen past the object: [height, width, 3]. camera: camera to world, OpenGL's axes."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], -1).reshape(-1, 3) @ camera[:3, :3].T
    origin = camera[:3, 3]
    with np.errstate(divide="ignore"):
        distance = np.where(rays > 0, room[1] - origin, room[0] - origin) / rays  # to the walls ahead of it
    axis = distance.argmin(1)
    out = np.zeros_like(rays)
    for a in range(3):
        others = [i for i in range(3) if i != a]
        for side in range(2):
            these = (axis == a) & ((rays[:, a] > 0) == bool(side))
            out[these] = walls[2 * a + side]((origin + rays[these] * distance[these, a:a + 1])[:, others])
    if origin[1] > top:
        down = rays[:, 1] < 0
        met = np.zeros_like(rays)
        met[down] = origin + rays[down] * ((top - origin[1]) / rays[down, 1:2])
        these = down & (np.abs(met[:, [0, 2]]) < reach).all(1)
        out[these] = table(met[these][:, [0, 2]])
    return out.reshape(height, width, 3)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("patterns", type=pathlib.Path)
    parser.add_argument("--every", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    o = parser.parse_args()
    folders = sorted(f.parent for f in o.set.glob("*/transforms.json"))
    patterns = sorted(o.patterns.glob("*.jpg"))
    if not folders or not patterns or o.every < 1:
        parser.error(f"objects in {o.set} (found {len(folders)}), *.jpg in {o.patterns} (found {len(patterns)}) and --every of 1 or more expected")
    for number, folder in enumerate(folders[::o.every]):
        rng = random.Random(o.seed * 1000 + number)
        views = json.loads((folder / "transforms.json").read_text())
        center, half = np.array(views["aabb_center"]), views["aabb_half"]
        farthest = max(np.abs(np.array(f["transform_matrix"])[:3, 3] - center).max() for f in views["frames"])
        size = np.array([farthest * rng.uniform(1.05, 1.8) for _ in range(3)])
        room, walls = (center - size, center + size), [surface(rng, patterns) for _ in range(6)]
        table, reach, top = surface(rng, patterns), half * rng.uniform(0.8, 2.5), center[1] - half * rng.uniform(0.6, 0.95)
        if rng.random() < 0.3:
            reach = 0
        out = o.out / folder.name
        (out / "images").mkdir(parents=True, exist_ok=True)
        for frame in views["frames"]:
            path = folder / frame["file_path"]
            rgba = np.asarray(Image.open(path if path.suffix else path.with_suffix(".png")).convert("RGBA")).astype("f8")
            height, width = rgba.shape[:2]
            angle = frame.get("camera_angle_x", views.get("camera_angle_x"))
            focal = width / 2 / math.tan(angle / 2) if angle else frame.get("fl_x", views.get("fl_x"))
            behind = background(np.array(frame["transform_matrix"]), width, height, focal, room, walls, table, top, reach)
            alpha = rgba[..., 3:] / 255
            picture = alpha * rgba[..., :3] + (1 - alpha) * behind
            Image.fromarray(np.rint(picture).clip(0, 255).astype("u1")).save(out / frame["file_path"])
        (out / "transforms.json").write_text(json.dumps(views))


if __name__ == "__main__":
    main()
