"""The scripts beside the shipped model in model/weights: the mean of models. Needs numpy."""
import importlib.util
import json
import os
import pathlib
import struct
import subprocess
import sys

import support

WEIGHTS = pathlib.Path(__file__).resolve().parents[2] / "model" / "weights"


def script(name, *arguments):
    done = subprocess.run([sys.executable, WEIGHTS / name, *map(str, arguments)], capture_output=True, text=True, timeout=support.PATIENCE)
    return done.returncode, done.stdout + done.stderr


def tensors(path):
    """Returns each F32 tensor's values."""
    with open(path, "rb") as f:
        header = json.loads(f.read(struct.unpack("<Q", f.read(8))[0]))
        data = f.read()
    header.pop("__metadata__")
    return {name: struct.unpack(f"<{(t['data_offsets'][1] - t['data_offsets'][0]) // 4}f", data[slice(*t["data_offsets"])])
            for name, t in header.items()}


class Scripts(support.Case):
    def setUp(self):
        super().setUp()
        if importlib.util.find_spec("numpy") is None:
            self.skipTest("without numpy")

    def mean(self, *arguments):
        code, result = script("mean.py", *arguments)
        self.assertEqual(code, 0, result)

    def refused(self, words, *arguments):
        code, result = script("mean.py", self.path("no.safetensors"), *arguments)
        self.assertNotEqual(code, 0)
        self.assertNotIn("Traceback", result)
        for word in words:
            self.assertIn(word, result)
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


if __name__ == "__main__":
    support.main()
