"""vsplat convert and vsplat info: surfels, formats, axes, what is left out, verification, and what files hold."""
import json
import math
import os
import pathlib
import random
import struct

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
        self.refuses(1, [self.scene, solid, "surfels"], "convert", self.scene, solid, "--output", self.path("none.ply"))


WHOLE = ["x", "y", "z", *(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(9)), "opacity", "scale_0", "scale_1", "scale_2",
         "rot_0", "rot_1", "rot_2", "rot_3"]


def write_whole(path, count=150, seed=5, centre=(0.0, 0.0, 0.0), comments=()):
    """Volumes of SH degree 1. Returns their rows as dictionaries."""
    draw = random.Random(seed)
    rows = []
    for _ in range(count):
        q = [draw.gauss(0, 1) for _ in range(4)]
        length = math.sqrt(sum(v * v for v in q))
        values = [*(c + draw.uniform(-0.4, 0.4) for c in centre), *(draw.uniform(-1, 1) for _ in range(3)), *(draw.uniform(-0.3, 0.3) for _ in range(9)),
                  draw.uniform(-2, 4), *(math.log(draw.uniform(0.02, 0.1)) for _ in range(3)), *(v / length for v in q)]
        rows.append(dict(zip(WHOLE, struct.unpack(f"<{len(WHOLE)}f", struct.pack(f"<{len(WHOLE)}f", *values)))))
    head = "".join(f"comment {each}\n" for each in comments) + f"element vertex {count}\n" + "".join(f"property float {n}\n" for n in WHOLE)
    with open(path, "wb") as f:
        f.write(f"ply\nformat binary_little_endian 1.0\n{head}end_header\n".encode())
        for row in rows:
            f.write(struct.pack(f"<{len(WHOLE)}f", *(row[n] for n in WHOLE)))
    return rows


def read_rows(path):
    """The comments, and the rows as dictionaries."""
    head, rows = pathlib.Path(path).read_bytes().split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    names = [line.split()[-1] for line in lines if line.startswith("property")]
    return [line[8:] for line in lines if line.startswith("comment ")], [dict(zip(names, row)) for row in struct.iter_unpack(f"<{len(names)}f", rows)]


def matrix_of(w, x, y, z):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def covariance(row):
    turn, scales = matrix_of(*(row[f"rot_{i}"] for i in range(4))), [math.exp(2 * row[f"scale_{i}"]) for i in range(3)]
    return [[sum(turn[i][k] * scales[k] * turn[j][k] for k in range(3)) for j in range(3)] for i in range(3)]


class Convert(support.Case):
    def setUp(self):
        super().setUp()
        self.scene = self.path("scene.ply")
        self.rows = write_whole(self.scene)

    def convert(self, *arguments, output="out.ply"):
        """Returns what --json tells, and the rows of the output."""
        result = json.loads(self.succeeds("convert", self.scene, *arguments, self.path(output), "--json", "--overwrite")[0])
        return result, read_rows(self.path(output)) if output == "out.ply" else None

    def middles(self, rows):
        return [(row["x"], row["y"], row["z"]) for row in rows]

    def test_nothing_asked_for_keeps_every_value(self):
        result, (_, rows) = self.convert()
        self.assertEqual((result["format"], result["gaussians"], result["sh_degree"], result["mirrored"]), ("ply", 150, 1, False))
        for before, after in zip(self.rows, rows, strict=True):
            for name in WHOLE:
                self.assertAlmostEqual(before[name], after[name], delta=2e-6 * max(1, abs(before[name])), msg=name)
        self.assertNotIn("lost", result)

    def test_axes(self):
        """By hand for one change of either hand: places, ellipsoids and the linear band, which is (-y, z, -x)."""
        def turned(sign, at, v):
            return [sign[i] * v[at[i]] for i in range(3)]

        for to, at, sign, mirrored in (("RUB", (0, 1, 2), (1, -1, -1), False), ("RFU", (0, 2, 1), (1, 1, -1), False), ("RUF", (0, 1, 2), (1, -1, 1), True)):
            with self.subTest(to=to):
                result, (comments, rows) = self.convert("--from", "rdf", "--to", to)
                self.assertEqual(result["mirrored"], mirrored)
                for before, after in zip(self.rows, rows, strict=True):
                    for a, b in zip(turned(sign, at, [before[c] for c in "xyz"]), (after[c] for c in "xyz")):
                        self.assertAlmostEqual(a, b, places=6)
                    given, made = covariance(before), covariance(after)
                    for i in range(3):
                        for j in range(3):
                            self.assertAlmostEqual(sign[i] * sign[j] * given[at[i]][at[j]], made[i][j], delta=1e-6)
                    for channel in range(3):
                        linear = lambda row: [-row[f"f_rest_{3 * channel + 2}"], -row[f"f_rest_{3 * channel}"], row[f"f_rest_{3 * channel + 1}"]]
                        for a, b in zip(turned(sign, at, linear(before)), linear(after)):
                            self.assertAlmostEqual(a, b, places=5)
                up = [float(v) for comment in comments if comment.startswith("vsplat up ") for v in comment.split()[2:]]
                self.assertEqual(up, turned(sign, at, (0, -1, 0)))
        for wrong in ("RD", "RDX", "RRF", "XYZ"):
            self.refuses(2, ["--to", "RDF"], "convert", self.scene, "--to", wrong, self.path("none.ply"))

    def test_upright_scaled_and_moved(self):
        _, (comments, rows) = self.convert("--up", "0,0,2", "--upright", "--scale", 2, "--translate", "-1,0,5")
        self.assertIn([0, -1, 0], [[round(float(v), 6) for v in c.split()[2:]] for c in comments if c.startswith("vsplat up ")])
        for before, after in zip(self.rows, rows, strict=True):  # z becomes -y, and so y becomes z
            for a, b in zip((2 * before["x"] - 1, -2 * before["z"], 2 * before["y"] + 5), (after[c] for c in "xyz")):
                self.assertAlmostEqual(a, b, places=5)
            self.assertAlmostEqual(before["scale_1"] + math.log(2), after["scale_1"], places=5)
        # Without --upright, up is only noted.
        _, (comments, rows) = self.convert("--up", "0,0,2")
        self.assertIn("vsplat up 0 0 1", comments)
        self.assertEqual(self.middles(rows), self.middles(self.rows))
        self.refuses(2, ["--upright", "--up"], "convert", self.scene, "--upright", self.path("none.ply"))
        self.refuses(2, "--up", "convert", self.scene, "--up", "0,0,0", self.path("none.ply"))

    def test_what_is_left_out(self):
        inside = lambda row: all(-0.2 <= row[c] <= h for c, h in zip("xyz", (0.3, 0.4, 0.1)))
        near = lambda row: sum((row[c] - m) ** 2 for c, m in zip("xyz", (0.1, 0, 0))) <= 0.09
        opaque = lambda row: 1 / (1 + math.exp(-row["opacity"])) >= 0.5
        small = lambda row: max(row[f"scale_{i}"] for i in range(3)) <= math.log(0.08)
        for arguments, stays, name in ((("--crop-box", "-0.2,-0.2,-0.2,0.3,0.4,0.1"), inside, "outside_box"), (("--crop-sphere", "0.1,0,0,0.3"), near, "outside_sphere"),
                                       (("--min-opacity", 0.5), opaque, "below_opacity"), (("--max-size", 0.08), small, "above_size")):
            with self.subTest(name=name):
                result, (_, rows) = self.convert(*arguments, "--to", "RDF")
                expected = [row for row in self.rows if stays(row)]
                self.assertTrue(0 < len(expected) < 150)
                self.assertEqual(self.middles(rows), self.middles(expected))
                self.assertEqual((result["removed"][name], result["gaussians"]), (150 - len(expected), len(expected)))
        result, (_, rows) = self.convert("--sh", 0)
        self.assertEqual((result["sh_degree"], "f_rest_0" in rows[0]), (0, False))
        self.assertEqual(self.convert("--sh", 3)[0]["sh_degree"], 1)
        for wrong in (("--crop-box", "1,2,3"), ("--crop-box", "1,0,0,0,1,1"), ("--crop-sphere", "0,0,0,0"), ("--min-opacity", "2"), ("--max-size", "-1"), ("--sh", "5"),
                      ("--sh", "1.5"), ("--max-gaussians", "0"), ("--scale", "0"), ("--translate", "1,2")):
            self.refuses(2, wrong[0], "convert", self.scene, *wrong, self.path("none.ply"))

    def test_the_least_visible_go_first(self):
        """A ball that hides smaller ones inside it: these go first."""
        splats = [((0.3 * math.sin(2.4 * i) * math.sqrt(1 - (i / 40 - 1) ** 2), 0.3 * (i / 40 - 1), 0.3 * math.cos(2.4 * i) * math.sqrt(1 - (i / 40 - 1) ** 2)),
                   (0.2, 0.5, 0.9), 0.08, 0.99) for i in range(1, 80)]
        hidden = [((0.02 * i - 0.1, 0.01, 0), (1, 0, 0), 0.01, 0.9) for i in range(10)]
        support.write_scene(self.scene, [*hidden[:5], *splats, *hidden[5:]])
        result, (_, rows) = self.convert("--max-gaussians", 79)
        self.assertEqual((result["gaussians"], result["removed"]["least_visible"]), (79, 10))
        self.assertEqual([round(row["y"], 4) for row in rows], [round(at[1], 4) for at, *_ in splats])
        self.assertEqual(self.convert("--max-gaussians", 89)[0]["removed"]["least_visible"], 0)

    def test_floaters(self):
        draw = random.Random(2)
        splats = [(tuple(draw.uniform(-0.2, 0.2) for _ in range(3)), (0.5, 0.5, 0.5), 0.02, 0.9) for _ in range(300)]
        support.write_scene(self.scene, [*splats, ((5, 0, 0), (1, 0, 0), 0.02, 0.9), ((0, -7, 1), (1, 0, 0), 0.02, 0.9)])
        result, (_, rows) = self.convert("--remove-floaters")
        self.assertEqual((result["removed"]["floaters"], len(rows)), (2, 300))
        self.assertLess(max(abs(row["x"]) for row in rows), 0.3)

    def test_several_become_one(self):
        other = write_whole(self.path("other.ply"), 40, 9, (2, 0, 0))
        result = json.loads(self.succeeds("convert", self.scene, self.path("other.ply"), "--output", self.path("both.ply"), "--json")[0])
        self.assertEqual(result["gaussians"], 190)
        self.assertEqual(self.middles(read_rows(self.path("both.ply"))[1]), self.middles(self.rows + other))
        self.refuses(1, "exists", "convert", self.scene, self.path("other.ply"))
        self.refuses(2, "OUT", "convert", self.scene)
        self.refuses(2, "is read", "convert", self.scene, self.scene, "--overwrite")
        self.refuses(2, ["OUT is", ".xyz", ".ply", ".spz", ".html"], "convert", self.scene, self.path("a.xyz"))
        self.refuses(2, ["--output is", ".xyz"], "convert", self.scene, "--output", self.path("a.xyz"))
        for name in ("a.ply", "a.html"):
            self.refuses(2, ["--spz-version", name], "convert", self.scene, "--spz-version", 2, self.path(name))

    def test_verification(self):
        result, _ = self.convert("--verify")
        self.assertEqual((result["verification"]["psnr"], result["verification"]["pictures"], result["verification"]["limit"]), (None, 8, 30))
        self.assertEqual(result["verification"]["difference"]["positions"]["largest"], 0)
        for version in (2, 3, 4):
            result, _ = self.convert("--verify=35", "--spz-version", version, output="out.spz")
            check = result["verification"]
            self.assertGreater(check["psnr"], 35)
            self.assertGreaterEqual(check["psnr"], check["worst"])
            self.assertTrue(check["in_order"])
            self.assertTrue(0 < check["difference"]["positions"]["rms"] <= check["difference"]["positions"]["largest"] < 1e-3)
            self.assertTrue(0 < check["difference"]["opacities"]["largest"] < 0.01)
            self.assertTrue(result["lost"])
        # Reductions count: they are compared with what was there before.
        result, _ = self.convert("--verify=5", "--max-gaussians", 60, "--sh", 0)
        self.assertTrue(5 < result["verification"]["psnr"] < 35)
        self.assertEqual(result["verification"]["difference"]["sh"]["largest"], 0)  # of what was written, in a PLY
        # The figures are those that a reader finds.
        self.succeeds("convert", self.path("out.spz"), self.path("back.ply"))
        furthest = max(math.dist(a, b) for a, b in zip(self.middles(self.rows), self.middles(read_rows(self.path("back.ply"))[1])))
        self.assertAlmostEqual(furthest, check["difference"]["positions"]["largest"], delta=1e-7)
        result, _ = self.convert("--verify=20", output="out.compressed.ply")  # in another order
        self.assertLess(result["verification"]["difference"]["positions"]["largest"], 0.01)

    def test_a_page(self):
        result, _ = self.convert("--verify=35", output="page.html")
        self.assertEqual((result["format"], result["viewer"], os.listdir(self.folder).count("page.ply")), ("html", self.path("page.html"), 0))
        self.assertIn("<html", pathlib.Path(self.path("page.html")).read_text())
        self.convert("--viewer", self.path("beside.html"))
        self.assertTrue(os.path.getsize(self.path("beside.html")) > 10000 and os.path.exists(self.path("out.ply")))

    def test_a_file_that_fails_is_not_written(self):
        before = self.rows
        write_whole(self.path("kept.spz.ply"), 10)
        self.refuses(1, ["not written", "at least 200 dB", "positions"], "convert", self.scene, "--verify=200", self.path("bad.spz"))
        self.succeeds("convert", self.path("kept.spz.ply"), self.path("kept.spz"))
        self.refuses(1, "not written", "convert", self.scene, "--verify=200", self.path("kept.spz"), "--overwrite")  # the old one stays
        self.assertEqual(len(before), 150)
        self.refuses(2, "--verify", "convert", self.scene, "--verify=-3", self.path("bad.spz"))

    def test_every_refusal_names_a_file(self):
        self.refuses(1, [self.scene, "range of floats"], "convert", self.scene, "--scale", "3e38", "--translate", "3e38,0,0", self.path("bad.ply"))
        self.succeeds("convert", self.scene, "--scale", "1e9", self.path("far.ply"))
        for more in ((), ("--verify",)):
            self.refuses(1, [self.path("far.spz"), "SPZ holds numbers below"], "convert", self.path("far.ply"), *more, self.path("far.spz"))
        self.refuses(2, ["a positive factor expected"], "convert", self.scene, "--scale", "0", self.path("bad.ply"))


class Info(support.Case):
    def info(self, name, *more):
        return json.loads(self.succeeds("info", self.path(name), "--json", *more)[0])

    def test_without_a_device(self):
        write_whole(self.path("scene.ply"))
        none = {"OCL_ICD_VENDORS": self.path("none"), "OCL_ICD_FILENAMES": "", "VSPLAT_DEVICE": ""}
        out, err = self.succeeds("info", self.path("scene.ply"), "--json", env=none)
        self.assertIsNone(json.loads(out)["memory"]["drawing"])
        self.assertIn("no OpenCL device", err)
        self.refuses(1, "no OpenCL device", "info", self.path("scene.ply"), "--picture", self.path("a.png"), env=none)
        self.succeeds("convert", self.path("scene.ply"), self.path("a.spz"), env=none)

    def test_what_a_file_holds(self):
        rows = write_whole(self.path("scene.ply"), comments=("vsplat up 0 0 1", "vsplat near 0.5"))
        result = self.info("scene.ply")
        self.assertEqual((result["format"], result["version"], result["bytes"]), ("ply", "binary_little_endian 1.0", os.path.getsize(self.path("scene.ply"))))
        self.assertEqual((result["gaussians"], result["kind"], result["sh_degree"], result["up"], result["near"]), (150, "volumes", 1, [0, 0, 1], 0.5))
        self.assertEqual(result["bounds"]["low"], [min(row[c] for row in rows) for c in "xyz"])
        self.assertEqual(result["bounds"]["high_99"], [sorted(row[c] for row in rows)[148] for c in "xyz"])
        self.assertAlmostEqual(result["shares"]["transparent"], sum(row["opacity"] < math.log(0.1 / 0.9) for row in rows) / 150)
        self.assertEqual(result["memory"]["gaussians"], 150 * 4 * (3 + 3 + 4 + 1 + 12))
        self.assertGreater(result["memory"]["drawing"], result["memory"]["gaussians"])
        out, _ = self.succeeds("info", self.path("scene.ply"))
        for words in ("3DGS PLY, binary_little_endian 1.0", "Gaussians      150", "opacity below 1/255", "1280 x 720"):
            self.assertIn(words, out)

    def test_formats(self):
        write_whole(self.path("scene.ply"))
        for name, format, version in (("a.spz", "spz", "version 4"), ("b.spz", "spz", "version 2"), ("a.compressed.ply", "compressed-ply", "binary_little_endian 1.0"),
                                      ("a.splat", "splat", None)):
            self.succeeds("convert", self.path("scene.ply"), *(("--spz-version", 2) if name == "b.spz" else ()), self.path(name))
            result = self.info(name)
            self.assertEqual((result["format"], result["version"], result["gaussians"]), (format, version, 150), name)
            self.assertEqual(result["axes"], "RUB" if format == "spz" else None)

    def test_what_is_bad_is_counted(self):
        write_whole(self.path("scene.ply"))
        data = bytearray(pathlib.Path(self.path("scene.ply")).read_bytes())
        begin = data.index(b"end_header\n") + len(b"end_header\n")
        size = 4 * len(WHOLE)
        data[begin:begin + 4] = struct.pack("<f", math.nan)
        data[begin + 2 * size - 16:begin + 2 * size] = bytes(16)  # a rotation of length 0
        pathlib.Path(self.path("scene.ply")).write_bytes(data)
        result = self.info("scene.ply")
        self.assertEqual((result["gaussians"], result["bad"]), (148, {"not_finite": 1, "huge_scale": 0, "zero_rotation": 1}))
        self.assertAlmostEqual(result["shares"]["bad"], 2 / 150)

    def test_picture(self):
        support.write_scene(self.path("red.ply"), [((0.1 * i, 0, 0), (1, 0, 0), 0.1, 0.99) for i in range(5)])
        result = self.info("red.ply", "--picture", self.path("small.png"))
        width, height, pixels = support.read_png(self.path("small.png"))
        self.assertEqual((result["picture"], width, height), (self.path("small.png"), 384, 384))
        middle = 3 * (height // 2 * width + width // 2)
        self.assertGreater(pixels[middle], 240)
        self.assertLess(pixels[middle + 1], 30)
        self.refuses(1, "exists", "info", self.path("red.ply"), "--picture", self.path("small.png"))
        self.refuses(2, ".png", "info", self.path("red.ply"), "--picture", self.path("small.gif"))

    def test_what_is_no_scene(self):
        self.refuses(1, "transforms.json", "info", self.views)
        self.refuses(1, "nothing.ply", "info", self.path("nothing.ply"))


if __name__ == "__main__":
    support.main()
