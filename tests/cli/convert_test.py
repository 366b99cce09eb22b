"""Scenes of surfels on the command line: drawn directly, and converted for other programs."""
import json
import math
import pathlib
import random
import struct
import unittest

import support

NAMES = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"]


class Surfels(support.Case):
    def setUp(self):
        super().setUp()
        self.scene = self.path("surfels.ply")
        draw = random.Random(3)
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex 200\n" + "".join(f"property float {n}\n" for n in NAMES) + "end_header\n"
        with open(self.scene, "wb") as f:
            f.write(head.encode())
            for _ in range(200):
                f.write(struct.pack("<13f", *(draw.uniform(-0.4, 0.4) for _ in range(3)), *(draw.uniform(-1, 1) for _ in range(3)), draw.uniform(0, 4),
                                    *(math.log(draw.uniform(0.02, 0.1)) for _ in range(2)), *(draw.gauss(0, 1) for _ in range(4))))

    def test_surfels_become_gaussians(self):
        solid = self.path("solid.ply")
        out, _ = self.succeeds("convert", self.scene, "--surfels-to-gaussians", 0.05, "--output", solid, "--json")
        self.assertEqual(json.loads(out)["gaussians"], 200)
        head, rows = pathlib.Path(solid).read_bytes().split(b"end_header\n", 1)
        names = [line.split()[-1] for line in head.decode().splitlines() if line.startswith("property")]
        given = pathlib.Path(self.scene).read_bytes().split(b"end_header\n", 1)[1]
        for flat, made in zip(struct.iter_unpack("<13f", given), struct.iter_unpack(f"<{len(names)}f", rows)):
            flat, made = dict(zip(NAMES, flat)), dict(zip(names, made))
            for name in NAMES[:9]:
                self.assertAlmostEqual(made[name], flat[name], delta=1e-5 * max(1, abs(flat[name])))
            self.assertAlmostEqual(made["scale_2"], min(flat["scale_0"], flat["scale_1"]) + math.log(0.05), places=4)
        pictures = []
        for path in (self.scene, solid):
            self.succeeds("render", path, "--cameras", "orbit:1", "--images", self.path("pictures"), "--size", "64x64", "--overwrite")
            pictures.append(support.read_png(self.path("pictures", "0000.png"))[2])
        self.assertGreater(support.psnr(*pictures), 18)
        for wrong in (0, -1, 1.5, "nan"):
            self.refuses(2, "thickness", "convert", self.scene, "--surfels-to-gaussians", wrong, "--output", self.path("none.ply"))
        self.refuses(2, "three scales", "convert", solid, "--surfels-to-gaussians", 0.1, "--output", self.path("none.ply"))
        self.refuses(2, "--surfels-to-gaussians", "convert", self.scene, "--output", self.path("none.ply"))


if __name__ == "__main__":
    support.main()
