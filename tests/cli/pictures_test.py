"""Uses of drawn pictures: formats, contact sheets, animations, comparisons."""
import json
import math
import os
import pathlib
import struct

import support

SPLATS = [((0.1 * i - 0.3, 0.05 * (i % 3) - 0.05, 0.07 * (i % 2)), (i / 6, 1 - i / 6, 0.4), 0.08, 0.8) for i in range(7)]


def webp_frames(path):
    """Returns the canvas, the number of loops (0: endless), and every frame's duration in milliseconds."""
    data = pathlib.Path(path).read_bytes()
    riff, size, kind = struct.unpack("<4sI4s", data[:12])
    assert (riff, kind, size + 8) == (b"RIFF", b"WEBP", len(data)), path
    at, canvas, loops, durations = 12, None, None, []
    number = lambda b: int.from_bytes(b, "little")
    while at < len(data):
        kind, size = struct.unpack("<4sI", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"VP8X":
            canvas = number(body[4:7]) + 1, number(body[7:10]) + 1
        elif kind == b"ANIM":
            loops = number(body[4:6])
        elif kind == b"ANMF":
            durations.append(number(body[12:15]))
        at += 8 + size + size % 2
    return canvas, loops, durations


def gif_frames(path):
    """Returns the canvas, loops (0: for ever), and every frame's duration in hundredths of a second."""
    data = pathlib.Path(path).read_bytes()
    assert data[:6] == b"GIF89a" and data[-1:] == b";", path
    palette = lambda packed: 3 << (packed & 7) + 1 if packed & 128 else 0
    at, loops, durations, frames = 13 + palette(data[10]), None, [], 0
    while data[at] != 0x3b:
        kind, body = data[at], at + 2
        if kind == 0x2c:  # a picture: its head, its colours, the size of codes
            frames, body = frames + 1, at + 11 + palette(data[at + 9])
        elif data[at + 1] == 0xf9:
            durations.append(int.from_bytes(data[at + 4:at + 6], "little"))
        elif data[at + 3:at + 14] == b"NETSCAPE2.0":
            loops = int.from_bytes(data[at + 16:at + 18], "little")
        while data[body]:
            body += 1 + data[body]
        at = body + 1
    assert frames == len(durations), path
    return struct.unpack("<HH", data[6:10]), loops, durations


class Pictures(support.Case):
    def setUp(self):
        super().setUp()
        support.write_scene(self.path("scene.ply"), SPLATS)

    def render(self, *more, cameras="orbit:3", size="32x24"):
        return ("render", self.path("scene.ply"), "--cameras", cameras, *(["--size", size] if size else []), *more)

    def test_jpeg(self):
        self.succeeds(*self.render("--images", self.path("png")))
        sizes = []
        for quality in ([], ["--quality", 50], ["--quality", 100]):
            folder = self.path("jpg" + "".join(map(str, quality)))
            self.succeeds(*self.render("--images", folder, "--format", "jpg", *quality))
            self.assertEqual(sorted(os.listdir(folder)), ["0000.jpg", "0001.jpg", "0002.jpg"])
            data = pathlib.Path(os.path.join(folder, "0000.jpg")).read_bytes()
            self.assertEqual((data[:3], data[-2:]), (b"\xff\xd8\xff", b"\xff\xd9"))
            sizes.append(len(data))
        self.assertTrue(sizes[1] < sizes[0] < sizes[2], sizes)
        out, _ = self.succeeds(*self.render("--compare", self.path("jpg"), "--json"))
        self.assertGreater(json.loads(out)["comparison"]["psnr"], 35)

    def test_dry_run_says_what_it_takes(self):
        for more in ([], ["--kernels", "gpu"], ["--exact-tiles"]):
            out, _ = self.succeeds(*self.render("--dry-run", "--json", *more, cameras="orbit:5", size="300x200"))
            plan = json.loads(out)[0]
            self.assertTrue(plan["fits"])
            self.succeeds(*self.render("--sheet", self.path("s.png"), "--profile", self.path("p.json"), "--overwrite", *more,
                                       cameras="orbit:5", size="300x200"))
            with open(self.path("p.json")) as file:
                self.assertEqual(json.load(file)["peak_bytes"], plan["peak_bytes"])
        self.succeeds(*self.render("--images", self.path("box")))
        self.succeeds(*self.render("--images", self.path("exact"), "--exact-tiles"))
        for name in os.listdir(self.path("box")):
            with open(self.path("box", name), "rb") as a, open(self.path("exact", name), "rb") as b:
                self.assertEqual(a.read(), b.read())

    def test_supersampling(self):
        """If a scene states its detail, a small picture of it is the mean of a finer one."""
        report = self.path("report.ply")
        text = pathlib.Path(self.path("scene.ply")).read_bytes()
        pathlib.Path(report).write_bytes(text.replace(b"end_header", b"comment vsplat detail 0.001 0 0 0\nend_header", 1))
        def drawn(folder, scene, *more, size="24x24"):
            self.succeeds("render", scene, "--cameras", "orbit:3", "--size", size, "--images", self.path(folder), *more)
            return [support.read_png(self.path(folder, f"{i:04}.png"))[2] for i in range(3)]
        plain, eight = drawn("plain", self.path("scene.ply")), drawn("eight", self.path("scene.ply"), "--supersample", 8)
        self.assertEqual(drawn("auto", report), eight)
        self.assertEqual(drawn("one", report, "--supersample", 1), plain)
        self.assertNotEqual(plain, eight)
        large = drawn("large", self.path("scene.ply"), size="192x192")
        for small, picture in zip(eight, large):
            for y in range(0, 24, 5):
                for x in range(0, 24, 5):
                    for c in range(3):
                        values = [picture[3 * ((8 * y + j) * 192 + 8 * x + i) + c] for j in range(8) for i in range(8)]
                        self.assertAlmostEqual(small[3 * (24 * y + x) + c], sum(values) / 64, delta=1.01)
        for wrong in ("0", "9", "two", "-1"):
            self.refuses(2, ["--supersample", wrong, "1 to 8"], "render", report, "--cameras", "orbit:3", "--images", self.path("no"),
                         f"--supersample={wrong}")

    def test_what_is_reconstructed_tells_how_fine_it_is(self):
        self.succeeds(*self.reconstruct("--center", "0.1,0.2,0.3", "--scale", 1.5, "--views", "0,1,2"))
        with open(self.path("out.ply"), "rb") as f:
            header = f.read(2000).split(b"end_header")[0].decode()
        report = [line.split()[3:] for line in header.splitlines() if line.startswith("comment vsplat detail ")]
        self.assertEqual(len(report), 1, header)
        width, *at = map(float, report[0])
        for a, b in zip(at, (0.1, 0.2, 0.3)):
            self.assertAlmostEqual(a, b, 6)
        views = json.loads(pathlib.Path(self.views).read_text())
        depths = []
        for frame in views["frames"]:
            m = frame["transform_matrix"]  # it looks along -z
            depths.append(sum((m[i][3] - p) * m[i][2] for i, p in enumerate((0.1, 0.2, 0.3))))
        self.assertAlmostEqual(width, sorted(depths)[1] / views["fl_x"], delta=1e-5)  # pictures of the model's size: none is resampled

    def test_sheet(self):
        out, _ = self.succeeds(*self.render("--sheet", self.path("new", "sheet.png"), "--images", self.path("png"), "--json"))
        self.assertEqual(json.loads(out)["sheet"], self.path("new", "sheet.png"))
        width, height, pixels = support.read_png(self.path("new", "sheet.png"))
        self.assertEqual((width, height), (2 * 32 + 3 * 8, 2 * (24 + 12) + 3 * 8))
        for i in range(3):                                              # small pictures keep every pixel
            _, _, own = support.read_png(self.path("png", f"{i:04d}.png"))
            x, y = 8 + i % 2 * 40, 8 + i // 2 * 44
            for row in range(24):
                at = 3 * ((y + row) * width + x)
                self.assertEqual(pixels[at:at + 3 * 32], own[3 * 32 * row:3 * 32 * (row + 1)])
            below = [pixels[3 * ((y + 24 + row) * width + x + column)] for row in range(12) for column in range(32)]
            self.assertGreater(sum(v < 128 for v in below), 20)         # its number
        self.succeeds(*self.render("--sheet", self.path("alone.png"), cameras="orbit:40", size="300x200"))
        self.assertFalse(os.path.exists(self.path("0000.png")))

    def test_turntable(self):
        self.succeeds(*self.render("--turntable", self.path("a.webp"), cameras="orbit:5"))
        self.assertEqual(webp_frames(self.path("a.webp")), ((32, 24), 0, [42, 41, 42, 42, 41]))
        self.succeeds(*self.render("--turntable", self.path("b.webp"), "--fps", "3", "--quality", "100", cameras="orbit:5"))
        self.assertEqual(webp_frames(self.path("b.webp")), ((32, 24), 0, [333, 334, 333, 333, 334]))
        self.succeeds(*self.render("--turntable", self.path("a again.webp"), cameras="orbit:5"))
        self.assertEqual(*(pathlib.Path(self.path(name)).read_bytes() for name in ("a.webp", "a again.webp")))

    def test_turntable_gif(self):
        """What the frames hold is read in the tests of the library."""
        arguments = self.render("--turntable", self.path("a.gif"), "--fps", "30", cameras="orbit:5")
        code, _, err = support.run(*arguments)
        if code == 2:  # a build without giflib
            self.assertIn("libgif-dev", err)
            return
        self.assertEqual(code, 0, err)
        self.assertEqual(gif_frames(self.path("a.gif")), ((32, 24), 0, [3, 4, 3, 3, 4]))

    def cameras(self, *sizes, **changes):
        """Writes our cameras.json with one camera for each size, named like the pictures of a folder. Returns its path."""
        path = self.path("cameras.json")
        with open(path, "w") as f:
            json.dump([{"file": f"shots/{name}.jpg", "w": w, "h": h, "fx": 30, "fy": 30, "cx": w / 2, "cy": h / 2, **changes,
                        "w2c": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]} for name, (w, h) in zip("abcdef", sizes)], f)
        return path

    def test_mixed_sizes(self):
        cameras = self.cameras((32, 24), (16, 48), (5, 5))
        self.succeeds(*self.render("--sheet", self.path("sheet.png"), "--images", self.path("x"), cameras=cameras, size=None))
        self.assertEqual(support.read_png(self.path("sheet.png"))[:2], (3 * (32 + 8) + 8, 48 + 12 + 2 * 8))
        self.refuses(2, ["--turntable", "camera 1", "16 x 48", "32 x 24", "--size"],
                     *self.render("--turntable", self.path("t.webp"), cameras=cameras, size=None))
        self.succeeds(*self.render("--turntable", self.path("t.webp"), cameras=cameras))

    def compared(self, *more, folder="given", **how):
        out, err = self.succeeds(*self.render("--compare", self.path(folder), "--json", *more, **how))
        return json.loads(out)["comparison"], err

    def test_comparison_with_what_was_drawn(self):
        self.succeeds(*self.render("--images", self.path("given")))
        result, err = self.compared()
        self.assertEqual([p["reference"] for p in result["pictures"]], [self.path("given", f"{i:04d}.png") for i in range(3)])
        for row in [result, *result["pictures"]]:
            self.assertGreaterEqual(row["psnr_cc"], row["psnr"])
            self.assertGreater(row["psnr"], 55)                         # the file is rounded to 8 bits, the drawn picture is not
            self.assertGreater(row["ssim"], 0.999)
            self.assertLessEqual(row["ssim"], 1)
        for word in ("PSNR", "psnr_cc", "SSIM", "mean", "0002"):
            self.assertIn(word, err)
        other, _ = self.compared("--background", "0,0,0")
        self.assertLess(other["psnr"], 15)
        self.assertAlmostEqual(other["psnr"], sum(p["psnr"] for p in other["pictures"]) / 3)

    def test_comparison_by_hand(self):
        cameras = self.cameras((32, 24), (32, 24))
        self.succeeds(*self.render("--images", self.path("drawn"), cameras=cameras, size=None))
        os.makedirs(self.path("given"))
        for i, name in enumerate("ab"):
            support.write_png(self.path("given", name + ".png"), 32, 24, [[(10 * i, 128, 255 - 5 * x) for x in range(32)] for _ in range(24)])
        result, _ = self.compared("--differences", self.path("off"), cameras=cameras, size=None)
        for i, name in enumerate("ab"):
            drawn, given, off = (support.read_png(self.path(*p))[2] for p in (("drawn", f"{i:04d}.png"), ("given", name + ".png"), ("off", f"{i:04d}.png")))
            row = result["pictures"][i]
            self.assertEqual((row["reference"], row["difference"]), (self.path("given", name + ".png"), self.path("off", f"{i:04d}.png")))
            self.assertAlmostEqual(row["psnr"], support.psnr(drawn, given), delta=0.05)
            for a, b, c in zip(drawn, given, off):
                self.assertLessEqual(abs(min(255, 4 * abs(a - b)) - c), 3)

    def test_larger_references_are_scaled_down(self):
        cameras = self.cameras((64, 48), (64, 48))
        os.makedirs(self.path("given"))
        for name in "ab":                                               # stripes of two pixels, whose mean is the drawn value
            support.write_png(self.path("given", name + ".png"), 64, 48, [[(254 if x % 4 < 2 else 0,) * 3 for x in range(64)]] * 48)
        support.write_scene(self.path("scene.ply"), [])
        how = {"cameras": cameras, "size": "16x12"}
        result, _ = self.compared("--background", "#7f7f7f", **how)
        self.assertTrue(result["psnr"] is None or result["psnr"] > 90)
        result, _ = self.compared("--background", "black", **how)
        self.assertAlmostEqual(result["psnr"], 20 * math.log10(255 / 127), places=4)
        result, _ = self.compared("--background", "#7f7f7f", cameras=cameras, size=None)
        self.assertLess(result["psnr"], 10)

    def test_background_colours(self):
        support.write_scene(self.path("scene.ply"), [])
        for text, colour in (("black", (0, 0, 0)), ("orange", (255, 165, 0)), ("#0a8F10", (10, 143, 16)), ("1,0,0.2", (255, 0, 51))):
            self.succeeds(*self.render("--images", self.path("x"), "--overwrite", "--background", text, cameras="orbit:1"))
            self.assertEqual(tuple(support.read_png(self.path("x", "0000.png"))[2][:3]), colour)

    def test_transparent_background(self):
        """The file's picture, composited over a colour, equals the picture drawn over that colour."""
        self.succeeds(*self.render("--images", self.path("x"), "--background", "transparent", "--sheet", self.path("x.png")))
        self.succeeds(*self.render("--images", self.path("y"), "--background", "#20c0ff"))
        self.succeeds(*self.render("--images", self.path("z"), "--sheet", self.path("z.png")))
        sheets = [support.read_png(self.path(name))[2] for name in ("x.png", "z.png")]
        self.assertLessEqual(max(abs(a - b) for a, b in zip(*sheets)), 1)   # sheets are white where nothing is drawn
        seen = set()
        for i in range(3):
            own, drawn = (support.read_png(self.path(name, f"{i:04d}.png"))[2] for name in "xy")
            self.assertEqual(len(own), 4 * 32 * 24)
            for pixel in range(32 * 24):
                alpha = own[4 * pixel + 3] / 255
                seen.add(own[4 * pixel + 3])
                for c, behind in enumerate((0x20, 0xc0, 0xff)):
                    self.assertLessEqual(abs(alpha * own[4 * pixel + c] + (1 - alpha) * behind - drawn[3 * pixel + c]), 2)
        self.assertIn(0, seen)
        self.assertGreater(len(seen), 20)

    def test_cameras_are_written(self):
        """Cameras and pictures together form a set of posed views, from which the same pictures are drawn again."""
        out, _ = self.succeeds(*self.render("--images", self.path("set", "images"), "--write-cameras", self.path("set", "cameras.json"), "--json"))
        self.assertEqual(json.loads(out)["cameras"], self.path("set", "cameras.json"))
        self.succeeds(*self.render("--images", self.path("again"), cameras=self.path("set"), size=None))
        for i in range(3):
            a, b = (pathlib.Path(self.path(*folder, f"{i:04d}.png")).read_bytes() for folder in (("set", "images"), ("again",)))
            self.assertEqual(a, b)
        self.succeeds("reconstruct", self.path("set"), "--model", self.model, "--output", self.path("out.ply"))   # its pictures are found
        out, _ = self.succeeds(*self.render("--write-cameras", self.path("alone.json"), "--size", "64x48", cameras=self.path("set"), size=None))
        cameras = json.load(open(self.path("alone.json")))
        self.assertEqual([(c["file"], c["w"], c["h"]) for c in cameras], [(f"{i:04d}.png", 64, 48) for i in range(3)])
        self.refuses(1, ["alone.json", "--overwrite"], *self.render("--write-cameras", self.path("alone.json")))
        self.refuses(2, "alone.json", *self.render("--write-cameras", self.path("alone.json"), "--overwrite", cameras=self.path("alone.json")))

    def test_overwriting_leaves_no_stale_frames(self):
        drawn = lambda count, *more: self.render("--images", self.path("x"), "--compare", self.path("given"), "--differences", self.path("off"), *more,
                                                 cameras=f"orbit:{count}")
        self.succeeds(*self.render("--images", self.path("given"), cameras="orbit:7"))
        self.succeeds(*drawn(7))
        for name in ("notes.txt", "0009.png"):                          # not of that run: there is no 0007.png
            open(self.path("x", name), "w").close()
        self.refuses(1, "--overwrite", *drawn(3))
        self.succeeds(*drawn(3, "--overwrite"))
        self.assertEqual(sorted(os.listdir(self.path("x"))), ["0000.png", "0001.png", "0002.png", "0009.png", "notes.txt"])
        self.assertEqual(sorted(os.listdir(self.path("off"))), ["0000.png", "0001.png", "0002.png"])
        self.assertEqual(len(os.listdir(self.path("given"))), 7)        # inputs stay unchanged

    def test_equal_and_tiny_pictures(self):
        support.write_scene(self.path("scene.ply"), [])
        os.makedirs(self.path("given"))
        support.write_png(self.path("given", "a.png"), 32, 10, [[(255, 255, 255)] * 32] * 10)
        result, err = self.compared(cameras=self.cameras((32, 10)), size=None)
        none = {"psnr": None, "psnr_cc": None, "ssim": None}
        self.assertEqual(result, {**none, "pictures": [{"reference": self.path("given", "a.png"), **none}]})
        self.assertIn("equal", err)

    def test_masks_come_over_the_background(self):
        support.write_scene(self.path("scene.ply"), [])
        for folder in ("photos", "photos/masks"):
            os.makedirs(self.path(folder))
        support.write_png(self.path("photos", "a.png"), 16, 16, [[(10, 200, 30)] * 8 + [(0, 0, 255)] * 8] * 16)
        support.write_png(self.path("photos", "masks", "a.png"), 16, 16, [[(0, 0, 0)] * 8 + [(255, 255, 255)] * 8] * 16)
        frame = {"file_path": "a.png", "mask_path": "masks/a.png", "transform_matrix": support.camera_to_world(0)}
        pathlib.Path(self.path("photos", "transforms.json")).write_text(json.dumps({"fl_x": 20, "w": 16, "h": 16, "frames": [frame]}))
        how = {"folder": "photos", "cameras": self.path("photos"), "size": None}
        result, _ = self.compared("--background", "0,0,1", **how)
        self.assertIsNone(result["psnr"])                               # everything is background
        result, _ = self.compared("--background", "0,1,1", **how)
        self.assertAlmostEqual(result["psnr"], -10 * math.log10(1 / 6), places=4)
        support.write_png(self.path("photos", "masks", "a.png"), 8, 16, [[(0, 0, 0)] * 8] * 16)
        self.refuses(1, ["masks/a.png", "8 x 16"], *self.render("--compare", self.path("photos"), "--turntable", self.path("t.webp"),
                                                                cameras=self.path("photos"), size=None))

    def test_comparison_refuses(self):
        cameras = self.cameras((32, 24), (32, 24))
        given = lambda *more, **how: self.render("--compare", self.path("given"), *more, **{"cameras": cameras, "size": None, **how})
        self.refuses(1, "given", *given())
        os.makedirs(self.path("given"))
        picture = lambda name, w=32: support.write_png(self.path("given", name), w, 24, [[(1, 2, 3)] * w] * 24)
        picture("a.png")
        self.refuses(1, ["camera 1 of 2", "given"], *given())
        picture("b.png", 31)
        self.refuses(1, ["b.png", "31 x 24", "32 x 24"], *given("--sheet", self.path("s.png")))
        self.refuses(1, ["a.png", "32 x 24", "64 x 48"], *given(size="64x48"))
        self.refuses(1, ["a.png", "32 x 24", "16 x 16"], *given(size="16x16"))
        picture("b.png")
        picture("b.jpeg")
        self.refuses(1, ["b.png", "b.jpeg"], *given())
        os.remove(self.path("given", "b.jpeg"))
        self.refuses(2, "is read", *given("--sheet", self.path("given", "b.png"), "--overwrite"))
        os.rename(self.path("given", "a.png"), self.path("given", "0000.png"))
        os.rename(self.path("given", "b.png"), self.path("given", "0001.png"))
        self.refuses(2, "is read", *given("--images", self.path("given"), "--overwrite", cameras="orbit:2", size="32x24"))

    def test_damaged_pictures_leave_nothing(self):
        cameras = self.cameras((32, 24), (32, 24))
        os.makedirs(self.path("given"))
        for name in ("a.png", "b.png"):
            support.write_png(self.path("given", name), 32, 24, [[(1, 2, 3)] * 32] * 24)
        with open(self.path("given", "b.png"), "r+b") as f:
            f.truncate(os.path.getsize(self.path("given", "b.png")) - 20)
        self.refuses(1, "b.png", *self.render("--compare", self.path("given"), "--images", self.path("new"), "--sheet", self.path("s.png"), "--turntable",
                                              self.path("t.webp"), "--differences", self.path("off"), cameras=cameras, size=None))

    def test_nothing_is_replaced_unasked(self):
        everything = self.render("--images", self.path("x"), "--sheet", self.path("s.png"), "--turntable", self.path("t.webp"))
        self.succeeds(*everything)
        for name in ("s.png", "t.webp"):
            os.rename(self.path("x"), self.path("y"))
            self.refuses(1, [name, "--overwrite"], *everything)
            os.remove(self.path(name))
            os.rename(self.path("y"), self.path("x"))
        self.succeeds(*everything, "--overwrite")
        self.refuses(2, "twice", *self.render("--images", self.path("x"), "--sheet", self.path("x", "0000.png"), "--overwrite"))

    def test_exr_beside_others(self):
        self.succeeds(*self.render("--sheet", self.path("png.png"), "--background", "0.2,0.5,1"))
        self.succeeds(*self.render("--sheet", self.path("exr.png"), "--background", "0.2,0.5,1", "--images", self.path("x"), "--format", "exr"))
        a, b = (support.read_png(self.path(name))[2] for name in ("png.png", "exr.png"))
        self.assertLessEqual(max(abs(x - y) for x, y in zip(a, b)), 1)  # drawn over black, shown over the background

    def test_surface_maps(self):
        """A flat, opaque Gaussian that faces the camera, 2 and a half units away."""
        names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
        head = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + "".join(f"property float {n}\n" for n in names) + "end_header\n"
        row = struct.pack("<14f", 0, 0, 0, 1, 1, 1, 8, math.log(0.2), math.log(0.2), math.log(0.002), 1, 0, 0, 0)
        pathlib.Path(self.path("wall.ply")).write_bytes(head.encode() + row)
        w2c = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2.5], [0, 0, 0, 1]]
        with open(self.path("c.json"), "w") as f:
            json.dump([{"file": f"{i}.png", "w": 33, "h": 33, "fx": 60, "fy": 60, "cx": 16.5, "cy": 16.5, "w2c": w2c} for i in range(2)], f)
        draw = ("render", self.path("wall.ply"), "--cameras", self.path("c.json"), "--maps", "expected,median,normal", "--images")
        self.succeeds(*draw, self.path("x"))
        self.assertEqual(len(os.listdir(self.path("x"))), 8)
        for name in ("expected", "median"):
            _, _, grey = support.read_png(self.path("x", f"0001.{name}.png"))
            self.assertEqual(struct.unpack(">1089H", grey)[16 * 33 + 16], 2500)
            self.assertEqual(struct.unpack(">1089H", grey)[0], 0)
        _, _, normals = support.read_png(self.path("x", "0000.normal.png"))
        self.assertEqual((tuple(normals[:3]), tuple(normals[3 * (16 * 33 + 16):][:3])), ((0, 0, 0), (128, 128, 255)))
        self.succeeds(*draw, self.path("y"), "--format", "exr")
        self.assertEqual(sorted(os.listdir(self.path("y"))), ["0000.exr", "0001.exr"])
        for name in ("expected.Z", "median.Z", "normal.X", "normal.Y", "normal.Z"):
            self.assertIn(name.encode() + b"\0", pathlib.Path(self.path("y", "0000.exr")).read_bytes())
        # Those of an earlier run with more cameras go.
        self.succeeds(*("orbit:1" if a == self.path("c.json") else a for a in draw), self.path("x"), "--overwrite", "--size", "16x16")
        self.assertEqual(sorted(os.listdir(self.path("x"))), ["0000.expected.png", "0000.median.png", "0000.normal.png", "0000.png"])
        self.refuses(2, ["--maps", "depth"], *self.render("--images", self.path("z"), "--maps", "depth"))
        self.refuses(2, "--maps applies to --images", *self.render("--sheet", self.path("s.png"), "--maps", "median"))

    def test_reconstruct(self):
        out, err = self.succeeds(*self.reconstruct("--render", self.views, "--compare", self.path("views", "images"), "--sheet", self.path("s.png"),
                                                   "--turntable", self.path("t.webp"), "--json"))
        result = json.loads(out)
        self.assertEqual(result["images"], 0)
        self.assertEqual(len(result["comparison"]["pictures"]), 3)
        self.assertTrue(0 < result["comparison"]["psnr"] < 60)
        self.assertEqual(len(webp_frames(self.path("t.webp"))[2]), 3)
        self.assertEqual(support.read_png(self.path("s.png"))[:2], (2 * 24 + 8, 2 * 36 + 8))
        self.assertIn("SSIM", err)


if __name__ == "__main__":
    support.main()
