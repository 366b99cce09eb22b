"""What model/weights keeps beside the shipped model: the mean of models, and objects before a background. Needs numpy and Pillow."""
import importlib.util
import json
import os
import pathlib
import struct
import subprocess
import sys

import support

WEIGHTS = pathlib.Path(__file__).resolve().parents[2] / "model" / "weights"
MISSING = [name for name in ("numpy", "PIL") if importlib.util.find_spec(name) is None]


def script(name, *arguments):
    done = subprocess.run([sys.executable, WEIGHTS / name, *map(str, arguments)], capture_output=True, text=True, timeout=support.PATIENCE)
    return done.returncode, done.stdout + done.stderr


def tensors(path):
    """-> each F32 tensor's values."""
    with open(path, "rb") as f:
        header = json.loads(f.read(struct.unpack("<Q", f.read(8))[0]))
        data = f.read()
    header.pop("__metadata__")
    return {name: struct.unpack(f"<{(t['data_offsets'][1] - t['data_offsets'][0]) // 4}f", data[slice(*t["data_offsets"])])
            for name, t in header.items()}


class Scripts(support.Case):
    def setUp(self):
        super().setUp()
        if MISSING:
            self.skipTest(f"without {' and '.join(MISSING)}")

    def mean(self, *arguments):
        code, told = script("mean.py", *arguments)
        self.assertEqual(code, 0, told)

    def refused(self, words, *arguments):
        code, told = script("mean.py", self.path("no.safetensors"), *arguments)
        self.assertNotEqual(code, 0)
        self.assertNotIn("Traceback", told)
        for word in words:
            self.assertIn(word, told)
        self.assertFalse(os.path.exists(self.path("no.safetensors")))

    def test_mean_of_two_models(self):
        other, out = self.path("other.safetensors"), self.path("mean.safetensors")
        self.succeeds("init", "micro", "--seed", 4, "--output", other, "--quiet")
        self.mean(out, self.model, 3, other, 1)
        a, b, c = (tensors(path) for path in (self.model, other, out))
        self.assertEqual(list(a), list(c))
        self.assertNotEqual(a, b)
        for name in a:
            for x, y, z in zip(a[name], b[name], c[name]):
                self.assertAlmostEqual(0.75 * x + 0.25 * y, z, delta=1e-6 * max(1, abs(x), abs(y)))
        info = lambda path: json.loads(self.succeeds("weights", "info", path, "--json")[0])
        self.assertEqual(info(self.model)["config"], info(out)["config"])
        image = 2 * info(out)["config"]["image"]
        self.mean(out, self.model, 1, "--image", image)
        self.assertEqual(tensors(out), a)
        self.assertEqual({**info(self.model)["config"], "image": image}, info(out)["config"])
        self.succeeds("weights", "verify", out)
        self.succeeds("reconstruct", self.views, "--model", out, "--output", self.path("out.ply"))

    def test_what_no_mean_is_of(self):
        self.succeeds("init", "micro", "--seed", 3, "--set", "voxel_ch=16", "--output", self.path("wide.safetensors"), "--quiet")
        self.refused(["wide.safetensors", "other tensors or shapes"], self.model, 1, self.path("wide.safetensors"), 1)
        self.refused(["a share after every model"], self.model)
        self.refused(["a number as share", "half"], self.model, "half")
        self.refused(["above 0"], self.model, 1, self.model, -1)

    def test_objects_before_a_background(self):
        from PIL import Image
        data, out = pathlib.Path(self.path("set")), pathlib.Path(self.path("out"))
        self.succeeds("dataset", "procedural", "--count", 3, "--solids", "--output", data, "--views", 32, "--size", 24, "--seed", 4)
        patterns = pathlib.Path(self.path("patterns"))
        patterns.mkdir()
        for i in range(3):
            Image.effect_noise((64, 64), 90 + i).convert("RGB").save(patterns / f"{i}.jpg")
        for folder in (out, pathlib.Path(self.path("again"))):
            code, told = script("backgrounds.py", data, folder, patterns, "--every", 2, "--seed", 5)
            self.assertEqual(code, 0, told)
        self.assertEqual(sorted(os.listdir(out)), ["solid_0000", "solid_0002"])
        inside, outside = 0, []
        for path in sorted(out.glob("*/images/*.png")):
            relative = path.relative_to(out)
            self.assertEqual(path.read_bytes(), pathlib.Path(self.path("again"), relative).read_bytes())
            width, height, picture = support.read_png(path)
            rgba = support.read_png(data / relative)[2]
            self.assertEqual((width, height, len(picture)), (24, 24, 3 * 24 * 24))
            for i in range(24 * 24):
                colour, was, alpha = picture[3 * i:3 * i + 3], rgba[4 * i:4 * i + 3], rgba[4 * i + 3]
                if alpha == 255:
                    self.assertEqual(colour, was)
                    inside += 1
                elif alpha == 0:
                    outside.append(colour)
        self.assertGreater(inside, 100)
        self.assertGreater(len(set(outside)), 20)
        self.assertLess(outside.count(b"\xff\xff\xff"), 0.9 * len(outside))
        for name in os.listdir(out):
            told, was = (json.loads((folder / name / "transforms.json").read_text()) for folder in (out, data))
            frames, before = told.pop("frames"), was.pop("frames")
            self.assertEqual(told, was)
            self.assertEqual(len(frames), len(os.listdir(out / name / "images")))
            self.assertIn(len(frames), range(8, 17))  # of 32: those in front of the plane
            for frame in frames:
                self.assertIn(frame, before)
        self.assertNotIn("Traceback", script("backgrounds.py", self.path("none"), out, patterns)[1])
        listed, _ = self.succeeds("dataset", "info", out)
        self.assertIn("solid_0002", listed)


if __name__ == "__main__":
    support.main()
