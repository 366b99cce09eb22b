#!/usr/bin/env python3
"""make_hostile.py --seed N OUT: makes malicious files, of every kind that once broke a reader or nearly did, and none of a user's.

Sizes, names, offsets, depths and texts follow from the seed. OUT contains a folder for each kind; `bait/`, which nothing may read; and
`hostile.json`, which lists each file made: its kind, its role (which command accepts it), and its path. The HDF5 library makes the files of
that format (libhdf5-dev, through ctypes); all others are written byte by byte. Uses only Python's standard library."""
import argparse
import json
import os
import random
import shutil
import sys

import checkpoints
import hdf5_files
import meshes
import models
import pictures
import scenes
import texts
import views

ROLES = ("config", "model", "views", "mesh", "hdf5", "compare", "selection", "scene", "run", "state", "textures", "lpips", "encoder", "checkpoint")


class Maker:
    """Shared by the makers of all kinds: random choices, sound inputs, and places for files."""
    def __init__(self, seed, out, sound):
        self.random, self.out, self.sound, self.made = random.Random(seed), out, sound, []
        os.makedirs(os.path.join(out, "bait"))
        # Files outside of their own folder that malicious files name: nothing may open them.
        for name in ("bait.mtl", "bait.bin", "bait.txt", "bait.h5", "bait.json"):
            self.write(os.path.join(out, "bait", name), b"\0" * 256)
        shutil.copy(self.sound_picture(), os.path.join(out, "bait", "bait.png"))

    def sound_picture(self):
        return os.path.join(self.sound, "set", "object", "images", "0000.png")

    def write(self, path, content):
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "wb") as f:
            f.write(content.encode("utf-8", "surrogateescape") if isinstance(content, str) else content)
        return path

    def add(self, kind, role, path, names=None):
        """names: what an error must name instead of the path's last part."""
        assert role in ROLES, role
        self.made.append({"kind": kind, "role": role, "path": os.path.relpath(path, self.out), "names": names or os.path.basename(path)})

    def file(self, kind, role, name, content):
        path = self.write(os.path.join(self.out, *kind.split("/"), name), content)
        self.add(kind, role, path)
        return path

    def folder(self, kind):
        path = os.path.join(self.out, *kind.split("/"))
        os.makedirs(path, exist_ok=True)
        return path

    def word(self, most=8):
        return "".join(self.random.choice("abcdefghijklmnopqrstuvwxyz") for _ in range(self.random.randint(3, most)))

    def escape(self):
        """Text that moves the cursor, sets the title, or ends a line if a terminal receives it unescaped."""
        return self.random.choice(("\x1b]0;owned\x07", "\x1b[2J\x1b[H", "\x1b[31mred", "\x9b2J", "\r\x1b[1A\x1b[2Kok", "\x7f\x08\x08", "a\nb: done", "\u202egnp.", "a\u2028b\u2029", "\ufeff\u2066x"))

    def outside(self, depth=8):
        """Returns names of files outside of the folder of a file, such as /etc/passwd."""
        up = "../" * self.random.randint(depth, depth + 8)
        return {"up": up + "etc/passwd", "absolute": "/etc/passwd", "zero": "/dev/zero", "up_zero": up + "dev/zero"}


def make(seed, out, sound):
    """sound: a folder with set/object (posed pictures), micro.safetensors, scene.ply and config.json. Returns what was made."""
    maker = Maker(seed, out, sound)
    for module in (texts, scenes, models, checkpoints, views, meshes, pictures, hdf5_files):
        module.make(maker)
    with open(os.path.join(out, "hostile.json"), "w") as f:
        json.dump(maker.made, f, indent=1)
    return maker.made


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--sound", help="sound files that were made before (default: OUT/sound, made by the command that $VSPLAT names)")
    parser.add_argument("out")
    options = parser.parse_args()
    sound = options.sound or os.path.join(options.out, "sound")
    if not os.path.isdir(sound):
        sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
        import rule
        import support
        os.makedirs(options.out, exist_ok=True)
        rule.make_sound(sound, support.run, support.write_scene)
    made = make(options.seed, options.out, sound)
    print(f"{len(made)} files of {len({m['kind'] for m in made})} kinds")


if __name__ == "__main__":
    sys.exit(main())
