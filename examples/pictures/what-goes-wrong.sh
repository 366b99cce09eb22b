#!/bin/sh
# Makes what-goes-wrong.webp, the picture in photographs.md: the skull of examples/data from a camera that no fit has seen, as it is
# photographed, fitted to the other 47 photographs, to six of them, with poses that are off by a degree, and without masks.
#   examples/pictures/what-goes-wrong.sh [VSPLAT]     four fits: some minutes of two cores. Needs Python's Pillow
set -eu
cd "$(dirname "$0")/../.."
vsplat=${1:-build/release/bin/vsplat}
set=examples/data/painted_skull
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 - $set "$work" <<'PYTHON'
import json, math, os, random, sys
source, work = sys.argv[1:]
whole = json.load(open(f"{source}/transforms.json"))
seen = next(f for f in whole["frames"] if f["file_path"] == "images/29.jpg")
others = [f for f in whole["frames"] if f is not seen]

def turned(frame, degrees, rng):
    """The camera turned about a random axis."""
    axis = [rng.gauss(0, 1) for _ in range(3)]
    x, y, z = (v / math.hypot(*axis) for v in axis)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = [[c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s],
            [y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s],
            [z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)]]
    m = frame["transform_matrix"]
    rows = [[sum(m[r][k] * turn[k][q] for k in range(3)) for q in range(3)] + [m[r][3]] for r in range(3)]
    return {**frame, "transform_matrix": rows + [m[3]]}

rng = random.Random(1)
variants = {"good": others, "few": others[::8], "poses": [turned(f, 1, rng) for f in others],
            "masks": [{k: v for k, v in f.items() if k != "mask_path"} for f in others]}
for name, frames in [*variants.items(), ("camera", [seen])]:
    os.makedirs(f"{work}/{name}")
    os.symlink(os.path.abspath(f"{source}/images"), f"{work}/{name}/images")
    if name not in ("masks", "camera"):
        os.symlink(os.path.abspath(f"{source}/masks"), f"{work}/{name}/masks")
    json.dump({**whole, "frames": frames}, open(f"{work}/{name}/transforms.json", "w"))
PYTHON
for name in good few poses masks; do
  "$vsplat" fit "$work/$name" --object --start random --steps 1500 --size 400 --holdout none --allow-outside --page none \
    --output "$work/$name.ply" --quiet
  "$vsplat" render "$work/$name.ply" --cameras "$work/camera" --images "$work/drawn-$name" --quiet
done
python3 - $set "$work" <<'PYTHON'
import glob, sys
from PIL import Image
source, work = sys.argv[1:]
box = (120, 40, 480, 360)
shown = [Image.composite(Image.open(f"{source}/images/29.jpg"), Image.new("RGB", (600, 400), "white"), Image.open(f"{source}/masks/29.png").convert("L"))]
shown += [Image.open(glob.glob(f"{work}/drawn-{name}/**/*.png", recursive=True)[0]).convert("RGB") for name in ("good", "few", "poses", "masks")]
out = Image.new("RGB", (5 * 200, 178), "white")
for i, picture in enumerate(shown):
    out.paste(picture.crop(box).resize((200, 178), Image.LANCZOS), (200 * i, 0))
out.save("examples/pictures/what-goes-wrong.webp", quality=80)
PYTHON
