"""vsplat evaluate --scenes: the protocol, the table, and the lists in examples/scenes on small folders of the published layouts."""
import json
import math
import os
import pathlib
import shutil
import struct

import support
from evaluate_test import write_alexnet

LISTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "examples", "scenes")
FIGURES = ["psnr", "psnr_cc", "ssim"]


def spots(count=60):
    return [(0.3 * math.sin(i), 0.3 * math.cos(2.3 * i), 0.3 * math.sin(5.1 * i)) for i in range(count)]


def rows(width, height, i):
    return [[((x * 13 + 40 * i) % 256, (y * 17 + 9 * i) % 256, (x * y * 5) % 256) for x in range(width)] for y in range(height)]


class Scenes(support.Case):
    def colmap(self, folder, pictures="images", factor=1, count=9, width=24, height=18):
        """A COLMAP model in binary, as the sets' authors publish them: ids run against the names, whose pictures may be scaled down."""
        os.makedirs(self.path(folder, "sparse", "0"))
        os.makedirs(self.path(folder, pictures))
        points = spots()
        with open(self.path(folder, "sparse", "0", "cameras.bin"), "wb") as f:
            f.write(struct.pack("<QIiQQ4d", 1, 1, 1, factor * width, factor * height, *(factor * v for v in (30.0, 30.0, width / 2, height / 2))))
        with open(self.path(folder, "sparse", "0", "images.bin"), "wb") as f:
            f.write(struct.pack("<Q", count))
            for i in range(count):
                turn = 2 * math.pi * i / count
                name = f"{count - 1 - i:03}.JPG"
                # A camera on a circle of radius 2 that looks at the origin: a rotation about y, and a step back.
                f.write(struct.pack("<I4d3dI", i + 1, math.cos(turn / 2), 0, math.sin(turn / 2), 0, 0, 0, 2, 1) + name.encode() + b"\0")
                f.write(struct.pack("<Q", len(points)) + b"".join(struct.pack("<ddq", 5, 5, k + 1) for k in range(len(points))))
                support.write_png(self.path(folder, pictures, name), width, height, rows(width, height, i))
        with open(self.path(folder, "sparse", "0", "points3D.bin"), "wb") as f:
            f.write(struct.pack("<Q", len(points)))
            for k, at in enumerate(points):
                f.write(struct.pack("<Q3d3BdQ", k + 1, *at, 120, 90, 60, 0.5, count) + b"".join(struct.pack("<II", i + 1, k) for i in range(count)))
        return folder

    def nerf(self, folder, counts):
        """nerf_synthetic: RGBA pictures without an ending in the lists, and depth and normal maps beside those of the test."""
        for part, count in counts.items():
            os.makedirs(self.path(folder, part))
            frames = []
            for i in range(count):
                path = self.path(folder, part, f"r_{i}")
                support.write_png(path + ".png", 20, 20, rows(20, 20, i))
                if part == "test":
                    for kind in ("depth", "normal"):
                        support.write_png(f"{path}_{kind}_0000.png", 20, 20, rows(20, 20, 99))
                frames.append({"file_path": f"./{part}/r_{i}", "rotation": 0.01, "transform_matrix": support.camera_to_world(360 / count * i, 4.0)})
            pathlib.Path(self.path(folder, f"transforms_{part}.json")).write_text(json.dumps({"camera_angle_x": 0.69, "frames": frames}))

    def scene(self, name):
        support.write_scene(self.path(name), [(at, (0.5, 0.4, 0.3), 0.06, 0.7) for at in spots()])
        return name

    def list(self, sets, name="list.json"):
        pathlib.Path(self.path(name)).write_text(json.dumps(sets))
        return ("evaluate", "--scenes", self.path(name))

    def test_the_protocol(self):
        """Every eighth view by name, from the first; the figures are those of vsplat render --compare."""
        self.colmap("set", count=17)
        sets = [{"name": "ready", "views": "set/sparse/0", "pictures": "set/images", "scene": self.scene("ball.ply"), "size": "full"}]
        (result,) = json.loads(self.succeeds(*self.list(sets), "--dry-run", "--json")[0])
        self.assertEqual([os.path.basename(name) for name in result["held_out"]], ["000.JPG", "008.JPG", "016.JPG"])
        self.assertEqual((result["fitted"], result["size"], result["scene"]), (14, "full", self.path("ball.ply")))
        out, _ = self.succeeds(*self.list(sets), "--json", "--output", self.path("t.md"), "--output", self.path("t.csv"), "--output", self.path("t.json"))
        (row,) = json.loads(out)["sets"]
        self.assertEqual(json.load(open(self.path("t.json")))["sets"], [row])
        self.assertEqual(list(row), ["name", "size", "pictures", *FIGURES, "gaussians", "steps", "seconds", "peak_mib"])
        self.assertEqual((row["size"], row["pictures"], row["gaussians"], row["steps"]), ([24, 18], 3, 60, None))
        compared = json.loads(self.succeeds("render", self.path("ball.ply"), "--cameras", self.path("set"), "--compare", self.path("set", "images"),
                                            "--background", "white", "--json", "--quiet")[0])["comparison"]["pictures"]
        kept = [p for p in compared if os.path.basename(p["reference"]) in ("000.JPG", "008.JPG", "016.JPG")]
        self.assertEqual(len(kept), 3)
        for figure in FIGURES:
            self.assertAlmostEqual(row[figure], sum(p[figure] for p in kept) / 3, 4, figure)
        markdown, csv = (pathlib.Path(self.path(name)).read_text() for name in ("t.md", "t.csv"))
        self.assertEqual(markdown.splitlines()[0], "| set | size | pictures | PSNR | psnr_cc | SSIM | Gaussians | steps | seconds | peak MiB |")
        self.assertIn(f"| ready | 24 x 18 | 3 | {row['psnr']:.2f} |", markdown)
        self.assertEqual(csv.splitlines()[0], "name,size,pictures,psnr,psnr_cc,ssim,gaussians,steps,seconds,peak_mib")
        self.assertEqual(len(csv.splitlines()), 2)

    def test_sets_are_fitted_without_what_is_held_out(self):
        self.colmap("set")
        os.mkdir(self.path("weights"))
        write_alexnet(self.path("weights", "alex.safetensors"))
        self.colmap("large", count=9, width=72, height=64)
        fit = {"start": "points", "steps": 4, "seed": 3}
        sets = [{"name": "a", "views": "set/sparse/0", "pictures": "set/images", "size": 16, "fit": fit, "output": "made/a.ply"},
                {"name": "b", "views": "large/sparse/0", "pictures": "large/images", "background": "black", "fit": fit}]
        result = json.loads(self.succeeds(*self.list(sets), "--json", "--quiet")[0])
        a, b = result["sets"]
        self.assertEqual((a["size"], a["pictures"], a["steps"], b["size"]), ([16, 12], 2, 4, [72, 64]))
        for figure in FIGURES:
            self.assertAlmostEqual(result["mean"][figure], (a[figure] + b[figure]) / 2)
        self.assertGreater(a["seconds"], 0)
        self.assertGreater(a["peak_mib"], 0)
        record = json.load(open(self.path("made", "a.fit.json")))
        self.assertEqual((record["counts"]["views"], record["counts"]["held_out"], record["settings"]["holdout"]), (7, 0, "none"))
        self.assertTrue(os.path.exists(self.path("made", "a.fit.html")))
        # The ready scene gives the same row, with what its fit recorded.
        ready = [{"name": "a", "views": "set/sparse/0", "pictures": "set/images", "size": 16, "scene": "made/a.ply"}]
        (again,) = json.loads(self.succeeds(*self.list(ready), "--json", "--quiet")[0])["sets"]
        self.assertEqual({**again, **{figure: a[figure] for figure in (*FIGURES, "peak_mib")}}, a)
        for figure in FIGURES:
            self.assertAlmostEqual(again[figure], a[figure], 2, figure)
        self.assertEqual((record["settings"]["background"], record["figures"]["background"]), ("sky", [0, 0, 0]))  # a whole scene
        # A record that is no record is warned of, and the scene is measured all the same.
        for wrong in ({**record["figures"], "steps": "many"}, {**record["figures"], "background": [1, 2, 3]}):
            pathlib.Path(self.path("made", "a.fit.json")).write_text(json.dumps({**record, "figures": wrong}))
            out, err = self.succeeds(*self.list(ready), "--json")
            self.assertRegex(err, r"a\.fit\.json: figures\.(steps|background) must be")
            self.assertIsNone(json.loads(out)["sets"][0]["steps"])
        # The fit is that of vsplat fit with the other views.
        fitted = record["settings"]["views"]
        self.succeeds("fit", self.path("set", "sparse", "0"), "--pictures", self.path("set", "images"), "--start", "points", "--steps", 4, "--seed", 3, "--size", 16,
                      "--views", fitted, "--holdout", "none", "--output", self.path("by-hand.ply"), "--quiet")
        self.assertEqual(pathlib.Path(self.path("by-hand.ply")).read_bytes(), pathlib.Path(self.path("made", "a.ply")).read_bytes())
        lpips = [{**sets[1], "name": "with weights"}]
        (row,) = json.loads(self.succeeds(*self.list(lpips), "--lpips", self.path("weights"), "--json", "--quiet")[0])["sets"]
        self.assertIsInstance(row["lpips_alex"], float)
        self.assertNotIn("lpips_vgg", row)

    def test_a_picture_that_its_mask_hides_is_left_out(self):
        self.colmap("set", count=17)
        masks = self.path("set", "masks")
        os.mkdir(masks)
        for i in range(17):
            support.write_png(os.path.join(masks, f"{i:03}.png"), 24, 18, [[(0 if i == 8 else 255,) * 3] * 24] * 18)
        ready = {"name": "ready", "views": "set", "scene": self.scene("ball.ply"), "size": "full", "masks": "ignore"}
        out, err = self.succeeds(*self.list([ready]), "--json")
        self.assertRegex(err, r"008\.JPG: no pixel of it is inside its mask")
        (row,) = json.loads(out)["sets"]
        self.assertEqual(row["pictures"], 3)
        shutil.rmtree(masks)
        whole = json.loads(self.succeeds("render", self.path("ball.ply"), "--cameras", self.path("set"), "--compare", self.path("set", "images"),
                                         "--background", "white", "--json", "--quiet")[0])["comparison"]["pictures"]
        seen = [p for p in whole if os.path.basename(p["reference"]) in ("000.JPG", "016.JPG")]
        for figure in FIGURES:
            self.assertAlmostEqual(row[figure], sum(p[figure] for p in seen) / 2, 4, figure)
        os.mkdir(masks)
        for i in range(17):
            support.write_png(os.path.join(masks, f"{i:03}.png"), 24, 18, [[(0,) * 3] * 24] * 18)
        code, _, err = support.run(*self.list([ready]))
        self.assertEqual(code, 1)
        self.assertIn("no pixel of the 3 pictures is inside its mask", err)

    def test_a_set_that_fails_is_reported_and_the_others_go_on(self):
        self.colmap("set")
        self.colmap("holes")
        os.remove(self.path("holes", "images", "008.JPG"))
        good = {"views": "set/sparse/0", "pictures": "set/images", "scene": self.scene("ball.ply")}
        sets = [{"name": "gone", "views": "nowhere", "scene": "ball.ply"}, {"name": "holes", **good, "views": "holes/sparse/0", "pictures": "holes/images"},
                {"name": "no scene", **good, "scene": "none.ply"}, {"name": "good", **good}]
        code, out, err = support.run(*self.list(sets), "--json", "--output", self.path("t.md"))
        self.assertEqual(code, 1, err)
        rows = json.loads(out)["sets"]
        self.assertEqual([row["name"] for row in rows], ["gone", "holes", "no scene", "good"])
        for row, word in zip(rows, ("nowhere", "008", "none.ply")):
            self.assertIn(word, row["error"])
            self.assertIn(f"{row['name']} is left out: ", err)
        self.assertGreater(rows[3]["psnr"], 0)
        self.assertIn("3 of 4 sets failed", err)
        self.assertIn("| gone | failed | - |", pathlib.Path(self.path("t.md")).read_text())

    def test_wrong_lists(self):
        self.colmap("set")
        good = {"name": "a", "views": "set/sparse/0", "pictures": "set/images", "fit": {"start": "points"}}
        for code, words, sets in ((1, ["list of objects"], {}), (1, ["list of objects"], []), (1, ["[0]", "an object"], [3]), (1, ["[0].name is missing"], [{}]),
                                  (1, ["[0].views is missing"], [{"name": "a"}]), (1, ["[0].colour: no such field"], [{**good, "colour": 1}]),
                                  (1, ["[1].name", "a"], [good, good]), (1, ["[0].size", "full"], [{**good, "size": 3}]),
                                  (2, ["[0].fit.step: no such setting", "steps"], [{**good, "fit": {"step": 1}}]),
                                  (2, ["[0].fit.holdout: no such setting"], [{**good, "fit": {"holdout": "none"}}]),
                                  (2, ["[0].fit.sh is 7"], [{**good, "fit": {"start": "points", "sh": 7}}]),
                                  (2, ["[0].fit.steps is"], [{**good, "fit": {"start": "points", "steps": "many"}}]),
                                  (2, ["[0].fit.near is"], [{**good, "fit": {"near": -1}}]), (2, ["[0].fit.center is"], [{**good, "fit": {"center": [1, 2]}}]),
                                  (2, ["[0].fit.object and --scene"], [{**good, "fit": {"object": True, "scene": True}}]),
                                  (2, ["[0].fit.masks: no such setting"], [{**good, "fit": {"masks": "ignore"}}]),
                                  (1, ["[0].masks", "ignore"], [{**good, "masks": "none"}]), (1, ["[0].invert-masks", "true"], [{**good, "invert-masks": 1}]),
                                  (1, ["[0].scene is a ready scene"], [{**good, "scene": "x.ply"}]), (2, ["[0].background"], [{**good, "background": "none"}]),
                                  (2, ["[0].output", ".ply"], [{**good, "output": "x.obj"}])):
            with self.subTest(words=words):
                self.refuses(code, [self.path("list.json"), *words], *self.list(sets))
        self.refuses(1, ["none.json"], "evaluate", "--scenes", self.path("none.json"))
        self.refuses(2, "--scenes", *self.list([good]), self.path("set"))
        self.refuses(2, ["--output", ".md"], *self.list([good]), "--output", self.path("t.txt"))
        self.refuses(2, "--scenes", "evaluate", self.path("set"), "--output", self.path("t.md"))
        self.refuses(2, ["list.json", "is read"], *self.list([good]), "--output", self.path("list.json"), "--overwrite")

    def test_the_published_layouts(self):
        names = sorted(os.listdir(LISTS))
        self.assertEqual(names, ["deep_blending.json", "mip_nerf_360.json", "nerf_synthetic.json", "tanks_and_temples.json"])
        for scene, factor in (("bicycle", 4), ("bonsai", 2), ("counter", 2), ("garden", 4), ("kitchen", 2), ("room", 2), ("stump", 4)):
            self.colmap(os.path.join("360_v2", scene), f"images_{factor}", factor)
            os.makedirs(self.path("360_v2", scene, "images"))
        for scene in ("tandt/train", "tandt/truck", "db/drjohnson", "db/playroom"):
            self.colmap(scene)
        for scene in ("chair", "drums", "ficus", "hotdog", "lego", "materials", "mic", "ship"):
            self.nerf(os.path.join("nerf_synthetic", scene), {"train": 4, "val": 2, "test": 3})
        for name in names:
            with self.subTest(name=name):
                sets = json.load(open(os.path.join(LISTS, name)))
                self.assertEqual({(s["size"], s["fit"]["steps"]) for s in sets}, {("full", 30000)})
                listed = json.loads(self.succeeds(*self.list(sets, name), "--dry-run", "--json")[0])
                synthetic = name == "nerf_synthetic.json"
                self.assertEqual({(each["fitted"], len(each["held_out"])) for each in listed}, {(4, 3) if synthetic else (7, 2)})
                for s in sets:
                    s["fit"]["steps"] = 2
                    if s["fit"]["start"] == "random":
                        s["fit"]["max-gaussians"] = 200
                result = json.loads(self.succeeds(*self.list(sets, name), "--json", "--quiet")[0])
                self.assertEqual([row["name"] for row in result["sets"]], [s["name"] for s in sets])
                for row in result["sets"]:
                    self.assertEqual((row["size"], row["steps"]), ([20, 20] if synthetic else [24, 18], 2), row)
                    self.assertGreater(row["psnr"], 3)


if __name__ == "__main__":
    support.main()
