#!/usr/bin/env python3
"""Makes this folder: resizes the 48 photographs with their masks and poses. Needs Pillow.

  make.py SET        a folder with transforms.json, images/ and masks/ of 1599 x 1066 pixels
"""
import json
import os
import sys

from PIL import Image

WIDTH, HEIGHT, QUALITY = 600, 400, 85
source, here = sys.argv[1], os.path.dirname(os.path.abspath(__file__))
with open(os.path.join(source, "transforms.json")) as f:
    views = json.load(f)
scale = WIDTH / views["w"]
assert round(views["h"] * scale, 6) == HEIGHT, "other proportions"
for name in ("fl_x", "fl_y", "cx", "cy"):
    views[name] *= scale
views["w"], views["h"] = WIDTH, HEIGHT
for name in ("images", "masks"):
    os.makedirs(os.path.join(here, name), exist_ok=True)
for frame in views["frames"]:
    picture = Image.open(os.path.join(source, frame["file_path"])).convert("RGB")
    picture.resize((WIDTH, HEIGHT), Image.BOX).save(os.path.join(here, frame["file_path"]), quality=QUALITY, optimize=True)
    mask = Image.open(os.path.join(source, frame["mask_path"])).convert("L").resize((WIDTH, HEIGHT), Image.BOX)
    mask.point(lambda v: 255 * (v >= 128)).convert("1").save(os.path.join(here, frame["mask_path"]), optimize=True)
with open(os.path.join(here, "transforms.json"), "w") as f:
    json.dump(views, f, indent=1)
    f.write("\n")
