"""Shared by the tests of the command line: running it, pictures, posed views. Uses only Python's standard library."""
import json
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

VSPLAT = os.environ["VSPLAT"]
os.environ.setdefault("VSPLAT_TUNING", "off")  # ignores a table of this machine
os.environ.setdefault("VSPLAT_SELFTEST", "ignore")  # and its verdicts
# A command that runs longer than this, in seconds, counts as hanging; several times as long with sanitizers.
PATIENCE = 280 * int(os.environ.get("VSPLAT_PATIENCE", "1"))


def run(*arguments, env=None, cwd=None):
    """Returns exit code, stdout and stderr."""
    done = subprocess.run([VSPLAT, *map(str, arguments)], capture_output=True, text=True, errors="backslashreplace", cwd=cwd, timeout=PATIENCE,
                          env={**os.environ, **(env or {})})
    return done.returncode, done.stdout, done.stderr


def write_png(path, width, height, rows):
    """rows: height lists of width (r, g, b)."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    data = b"".join(b"\0" + bytes(v for pixel in row for v in pixel) for row in rows)
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
                + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


def write_grey_png(path, width, height, values):
    """16 bits; values: whole numbers, by rows."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    data = b"".join(b"\0" + struct.pack(f">{width}H", *values[width * y:width * (y + 1)]) for y in range(height))
    pathlib.Path(path).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0))
                                   + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


def read_png(path):
    """Returns width, height, and the bytes of all pixels (8-bit RGB or RGBA, or 16-bit grey: two bytes each)."""
    data = pathlib.Path(path).read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n", path
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            channels = {(8, 2): 3, (8, 6): 4, (16, 0): 2}[depth, colour]
        packed += body if kind == b"IDAT" else b""
        at += 12 + size
    raw, stride, out = zlib.decompress(packed), channels * width, bytearray()
    before = bytearray(stride)
    for y in range(height):
        kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            a, b, c = row[i - channels] if i >= channels else 0, before[i], before[i - channels] if i >= channels else 0
            p = a + b - c
            nearest = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            row[i] = (row[i] + (0, a, b, (a + b) // 2, nearest)[kind]) & 255
        out += row
        before = row
    return width, height, bytes(out)


def write_scene(path, splats):
    """splats: (x, y, z), (r, g, b), standard deviation and opacity of each; isotropic, without view-dependent colour."""
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(splats)}\n" + "".join(f"property float {n}\n" for n in names) + "end_header\n"
    with open(path, "wb") as f:
        f.write(head.encode())
        for at, colour, size, opacity in splats:
            f.write(struct.pack("<14f", *at, *((c - 0.5) / 0.28209479177387814 for c in colour), math.log(opacity / (1 - opacity)),
                                *[math.log(size)] * 3, 1, 0, 0, 0))


def psnr(a, b):
    mse = sum((x - y) ** 2 for x, y in zip(a, b)) / len(a)
    return math.inf if mse == 0 else 10 * math.log10(255 ** 2 / mse)


def camera_to_world(azimuth, distance=2.0, centre=(0.0, 0.0, 0.0)):
    """OpenGL axes: at `azimuth` (degrees) about y, looking at the centre."""
    s, c = math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth))
    return [[c, 0, s, centre[0] + distance * s], [0, 1, 0, centre[1]], [-s, 0, c, centre[2] + distance * c], [0, 0, 0, 1]]


class FolderCase(unittest.TestCase):
    """Runs each test in a folder of its own."""
    SIDE = 16

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="vsplat-cli-")
        self.addCleanup(shutil.rmtree, self.folder, True)

    def path(self, *parts):
        return os.path.join(self.folder, *parts)

    def make_views(self, name="views", count=3, centre=(0.0, 0.0, 0.0), **changes):
        """changes: top-level fields of the transforms.json. Returns its path."""
        os.makedirs(self.path(name, "images"))
        frames = []
        for i in range(count):
            rows = [[((x * 13 + 40 * i) % 256, (y * 17) % 256, (x * y * 5) % 256) for x in range(self.SIDE)] for y in range(self.SIDE)]
            write_png(self.path(name, "images", f"{i}.png"), self.SIDE, self.SIDE, rows)
            frames.append({"file_path": f"images/{i}.png", "transform_matrix": camera_to_world(100 * i, centre=centre)})
        path = self.path(name, "transforms.json")
        pathlib.Path(path).write_text(json.dumps({"fl_x": 20, "w": self.SIDE, "h": self.SIDE, "frames": frames, **changes}))
        return path

    def edit_views(self, change):
        data = json.loads(pathlib.Path(self.views).read_text())
        change(data)
        pathlib.Path(self.views).write_text(json.dumps(data))

    def snapshot(self):
        out = {}
        for root, folders, files in os.walk(self.folder):
            for name in folders:
                out[os.path.join(root, name)] = None
            for name in files:
                path = os.path.join(root, name)
                out[path] = pathlib.Path(path).read_bytes() if os.path.isfile(path) else "no file"  # reading a pipe would block
        return out

    def refuses(self, code, words, *arguments, env=None):
        """Ends with `code`, prints all of `words` on stderr and nothing on stdout, and leaves every file unchanged."""
        before = self.snapshot()
        got, out, err = run(*arguments, env=env)
        self.assertEqual(got, code, err)
        for word in [words] if isinstance(words, str) else words:
            self.assertIn(word, err)
        self.assertEqual(out, "")
        self.assertNotIn("terminate called", err)
        self.assertEqual(before, self.snapshot(), "files changed")
        return err

    def succeeds(self, *arguments, env=None):
        code, out, err = run(*arguments, env=env)
        self.assertEqual(code, 0, err)
        return out, err

    def reconstruct(self, *more):
        """Arguments of the main job."""
        return ("reconstruct", self.views, "--model", self.model, "--output", self.path("out.ply"), *more)


class Case(FolderCase):
    """With `model.safetensors` (micro) and posed views."""

    def setUp(self):
        super().setUp()
        self.model = self.path("model.safetensors")
        self.succeeds("init", "micro", "--seed", 3, "--output", self.model, "--quiet")
        self.views = self.make_views()


def slow(test):
    """A test that is not among the quick ones; its docstring or comment names the quick test that covers part of it."""
    test.slow = True
    return test


def main():
    """Selects what is named, a class or one of its tests, or everything. For a class: the tests that are not slow; with --slow the slow ones."""
    words = [word for word in sys.argv[1:] if word != "--slow"]
    wanted = "--slow" in sys.argv
    kinds = {name: kind for name, kind in vars(sys.modules["__main__"]).items() if isinstance(kind, type) and issubclass(kind, unittest.TestCase)}
    tests = []
    for word in [word for word in words if not word.startswith("-")] or kinds:
        if word in kinds:
            names = unittest.defaultTestLoader.getTestCaseNames(kinds[word])
            tests += [f"{word}.{name}" for name in names if getattr(getattr(kinds[word], name), "slow", False) == wanted]
        else:
            tests.append(word)
    if not tests:
        sys.exit("there is no such test")
    unittest.main(argv=[sys.argv[0], "-v", *(word for word in words if word.startswith("-")), *tests])
