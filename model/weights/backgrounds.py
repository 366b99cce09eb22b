#!/usr/bin/env python3
"""Objects of a data set on a table or before a wall, as photographs without masks show them.

    model/weights/backgrounds.py SET OUT PATTERNS [--every N] [--seed S]

SET is a folder of folders as `vsplat dataset render` writes them (y up, RGBA with straight alpha); every N-th of its objects by name
goes to OUT with RGB pictures of the same size and cameras: those on the front of a plane that touches the cube's lower side or another one,
has a colour or one of the pictures of PATTERNS, and ends with the cube or far beyond it. Same arguments, same bytes. Needs numpy and Pillow.
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


def behind(camera, width, height, focal, normal, point, reach, colours):
    """What is seen past the object, [height, width, 3]: the plane through `point` as far as `reach` from there, else white. camera: camera
    to world, OpenGL's axes."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], -1).reshape(-1, 3) @ camera[:3, :3].T
    origin = camera[:3, 3]
    towards = rays @ normal
    met = towards < 0
    at = origin + rays[met] * ((point - origin) @ normal / towards[met])[:, None] - point
    along = np.cross(normal, [0, 0, 1] if abs(normal[1]) > 0.5 else [0, 1, 0])
    along /= np.linalg.norm(along)
    uv = at @ np.stack([along, np.cross(normal, along)], 1)
    near = (np.abs(uv) < reach).all(1)
    out = np.full_like(rays, 255)
    out[np.flatnonzero(met)[near]] = colours(uv[near])
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
        normal = np.array([0.0, 1.0, 0.0])
        if rng.random() < 0.5:
            turn = rng.uniform(0, 2 * math.pi)
            normal = np.array([math.cos(turn), 0, math.sin(turn)])
        point = center - half * rng.uniform(0.8, 0.98) * normal
        reach = half * (rng.uniform(0.8, 1.1) if rng.random() < 0.6 else 20)
        colours = surface(rng, patterns)
        seen = []
        for frame in views["frames"]:
            away = np.array(frame["transform_matrix"])[:3, 3] - center
            if away @ normal > 0.3 * np.linalg.norm(away):
                seen.append(frame)
        if len(seen) < 8:
            continue
        views["frames"], out = seen, o.out / folder.name
        (out / "images").mkdir(parents=True, exist_ok=True)
        for frame in views["frames"]:
            path = folder / frame["file_path"]
            rgba = np.asarray(Image.open(path if path.suffix else path.with_suffix(".png")).convert("RGBA")).astype("f8")
            height, width = rgba.shape[:2]
            angle = frame.get("camera_angle_x", views.get("camera_angle_x"))
            focal = width / 2 / math.tan(angle / 2) if angle else frame.get("fl_x", views.get("fl_x"))
            plane = behind(np.array(frame["transform_matrix"]), width, height, focal, normal, point, reach, colours)
            alpha = rgba[..., 3:] / 255
            picture = alpha * rgba[..., :3] + (1 - alpha) * plane
            Image.fromarray(np.rint(picture).clip(0, 255).astype("u1")).save(out / frame["file_path"])
        (out / "transforms.json").write_text(json.dumps(views))


if __name__ == "__main__":
    main()
