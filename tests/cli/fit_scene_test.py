"""vsplat fit for whole scenes: an object before its background, from photographs without masks."""
import json
import math
import os
import re
import struct
import unittest

import support

NEAR_BALL, WALL = 40, 160


def scene():
    """A ball of many colours before a wall with stripes, which no cube about the ball holds."""
    ball = [((0.25 * math.sin(i), 0.25 * math.cos(2.3 * i), 0.25 * math.sin(5.1 * i)), (0.5 + 0.5 * math.sin(i), 0.6, 0.3), 0.08, 0.9)
            for i in range(NEAR_BALL)]
    wall = [((-3.75 + 0.5 * (i % 16), -2.25 + 0.5 * (i // 16), -4), (0.2, 0.3, 0.9) if i % 3 else (0.9, 0.8, 0.1), 0.3, 0.95) for i in range(WALL)]
    return ball, wall


class FitScene(support.Case):
    def setUp(self):
        super().setUp()
        ball, wall = scene()
        support.write_scene(self.path("truth.ply"), ball + wall)
        frames = [{"file_path": f"images/{i:04}.png", "transform_matrix": support.camera_to_world(6 * i - 33, 2.5)} for i in range(12)]
        self.list = {"fl_x": 40, "fl_y": 40, "cx": 24, "cy": 18, "w": 48, "h": 36, "frames": frames}
        self.write_list("transforms.json", self.list)
        self.succeeds("render", self.path("truth.ply"), "--cameras", self.path("transforms.json"), "--images", self.path("images"), "--quiet",
                      "--background", "black")
        self.write_points(ball + wall)

    def write_list(self, name, content):
        with open(self.path(name), "w") as f:
            json.dump(content, f)

    def write_points(self, splats):
        head = f"ply\nformat ascii 1.0\nelement vertex {len(splats)}\n"
        head += "".join(f"property float {n}\n" for n in "xyz") + "".join(f"property uchar {n}\n" for n in ("red", "green", "blue")) + "end_header\n"
        with open(self.path("points.ply"), "w") as f:
            f.write(head + "".join(" ".join(map(str, (*at, *(round(255 * c) for c in colour)))) + "\n" for at, colour, *_ in splats))

    def fit(self, *more, views="transforms.json", output="out.ply", steps=300):
        return ("fit", self.path(views), "--output", self.path(output), "--steps", steps, "--seed", 3, *more)

    def json_of(self, *arguments):
        out, err = self.succeeds(*arguments, "--json")
        return json.loads(out), err

    def test_without_masks_the_whole_scene_is_fitted(self):
        whole, err = self.json_of(*self.fit())
        self.assertIn("the whole scene: centre", err)
        self.assertIn(f"next: vsplat view {self.path('out.ply')} --cameras {self.path('transforms.json')}", err)
        self.assertEqual(len(whole["measured_on"]), 2)
        self.assertGreater(whole["result"]["psnr"], 16.5)
        same, _ = self.json_of(*self.fit("--scene", output="same.ply"))
        self.assertEqual(open(self.path("out.ply"), "rb").read(), open(self.path("same.ply"), "rb").read())
        self.assertAlmostEqual(sum(picture["psnr"] for picture in whole["held_out"]) / 2, whole["result"]["psnr"], 1)
        with open(self.path("out.fit.json")) as f:
            record = json.load(f)
        self.assertEqual([record["settings"][name] for name in ("start", "scene", "steps", "size", "background", "consolidate")],
                         ["auto", False, 300, 512, "sky", None])
        self.assertEqual(record["derived"]["extent"], "scene")
        self.succeeds("fit", self.path("transforms.json"), "--settings", self.path("out.fit.json"), "--output", self.path("again.ply"), "--quiet")
        self.assertEqual(open(self.path("out.ply"), "rb").read(), open(self.path("again.ply"), "rb").read())
        # What a whole scene derived is not given back to an object.
        result, _ = self.json_of(*self.fit("--object", "--start", "random", "--settings", self.path("out.fit.json"), "--quality", "draft", steps=3,
                                      output="settings.ply"))
        with open(result["settings"]) as f:
            settings = json.load(f)["settings"]
        self.assertEqual((settings["object"], settings["scene"], settings["background"]), (True, False, "auto"))
        cube, err = self.json_of(*self.fit("--object", "--start", "random", output="object.ply"))
        self.assertIn("the object's cube: centre", err)
        self.assertGreater(whole["result"]["psnr"], cube["result"]["psnr"] + 1)

    def test_points_make_the_start_and_better_scenes(self):
        without, _ = self.json_of(*self.fit())
        self.write_list("listed.json", {**self.list, "ply_file_path": "points.ply"})
        listed, err = self.json_of(*self.fit(views="listed.json", output="listed.ply"))
        self.assertIn(f"starts from {NEAR_BALL + WALL} points", err)
        self.assertGreater(listed["result"]["psnr"], without["result"]["psnr"])

    def test_with_few_pictures_some_are_held_out_for_the_whole_fit(self):
        self.write_list("few.json", {**self.list, "frames": self.list["frames"][::2]})
        said = self.succeeds(*self.fit(views="few.json", steps=5))[1]
        self.assertIn("1 picture that it was not fitted to:", said)
        self.assertNotIn("in turn", said)

    def test_a_near_plane_that_cuts_points_is_warned_of(self):
        self.write_list("listed.json", {**self.list, "ply_file_path": "points.ply"})
        _, err = self.succeeds(*self.fit("--near", 4, views="listed.json", steps=1))
        self.assertRegex(err, r"cuts away \d+ of the 200 points .* --near")
        _, err = self.succeeds(*self.fit("--near", 0.5, views="listed.json", steps=1), "--overwrite")
        self.assertNotIn("cuts away", err)
        with open(self.path("out.ply"), "rb") as f:
            self.assertIn(b"comment vsplat near 0.5\n", f.read(2000))

    def test_the_networks_object_is_among_points(self):
        self.write_list("listed.json", {**self.list, "ply_file_path": "points.ply"})
        network = ("--start", "network", "--model", self.model, "--center", "0,0,0", "--scale", 1)
        _, err = self.succeeds(*self.fit("--scene", *network, views="listed.json", steps=1))
        # Far ones are added to the points.
        around = re.search(r"(\d+) of the (\d+) Gaussians at the start lie in the object's cube", err)
        self.assertEqual(int(around[1]), NEAR_BALL, err)
        self.assertGreaterEqual(int(around[2]), NEAR_BALL + WALL)
        with open(self.path("out.fit.json")) as f:
            record = json.load(f)
        self.assertEqual(record["derived"]["extent"], "scene")
        self.assertGreater(record["counts"]["start"], WALL + 100)
        # An object in the same cube has none of the wall.
        self.succeeds(*self.fit(*network, views="listed.json", steps=1, output="object.ply"), "--quiet")
        with open(self.path("object.fit.json")) as f:
            self.assertEqual(json.load(f)["derived"]["extent"], "object")

    def test_a_dry_run_counts_growth(self):
        self.write_list("listed.json", {**self.list, "ply_file_path": "points.ply"})

        def planned(*more):
            out, _ = self.succeeds("fit", self.path("listed.json"), "--dry-run", "--json", *more)
            return json.loads(out)[0]

        large = ("--max-gaussians", 60000)
        grown = planned("--steps", 2000, *large)
        small = min(planned("--steps", 2000)["seconds"] for _ in range(3))  # a step is timed: other work may slow one
        self.assertGreater(grown["seconds"], 2 * small)  # some ten times on an idle machine, once if growth did not count
        self.assertIn("up to 60000 Gaussians of degree 3", grown["what"])
        # The memory is counted once.
        self.succeeds(*self.fit(*large, views="listed.json", steps=3), "--quiet")
        with open(self.path("out.fit.json")) as f:
            taken = json.load(f)["figures"]["peak_bytes"]
        self.assertLess(grown["peak_bytes"], 1.5 * taken)
        self.assertGreater(grown["peak_bytes"], 0.7 * taken)

    def test_depth(self):
        """From random points, depths that are given bring the Gaussians to their places."""
        def drawn(scene, folder):
            self.succeeds("render", self.path(scene), "--cameras", self.path("transforms.json"), "--images", self.path(folder), "--quiet",
                          "--maps", "expected", "--background", "black")
            pictures = [support.read_png(self.path(folder, f"{i:04}.expected.png")) for i in range(12)]
            return [struct.unpack(f">{48 * 36}H", pixels) for _, _, pixels in pictures]

        truth = drawn("truth.ply", "depth")

        def written(name, of):
            """A list with depth pictures that have `of` of each depth in thousandths."""
            os.makedirs(self.path(name), exist_ok=True)
            frames = []
            for i, frame in enumerate(self.list["frames"]):
                support.write_grey_png(self.path(name, f"{i}.png"), 48, 36, [round(of(v)) if v else 0 for v in truth[i]])
                frames.append({**frame, "depth_file_path": f"{name}/{i}.png"})
            self.write_list(f"{name}.json", {**self.list, "frames": frames})
            return f"{name}.json"

        def fitted(name, *more, views="transforms.json"):
            out, _ = self.succeeds(*self.fit("--scene", "--start", "random", *more, views=views, output=f"{name}.ply", steps=400), "--json")
            off = [abs(math.log(is_at / at)) for was, now in zip(truth, drawn(f"{name}.ply", name)) for at, is_at in zip(was, now) if at and is_at]
            return sum(off) / len(off), json.loads(out)["result"]["psnr"]

        plain, psnr = fitted("plain")
        with open(self.path("plain.fit.json")) as f:
            self.assertIsNone(json.load(f)["settings"]["depth"])
        for kind, of in (("metric", lambda v: v), ("relative", lambda v: 3 * v + 4000), ("inverse", lambda v: 6e7 / v - 2000)):
            with self.subTest(kind=kind):
                error, other = fitted(kind, "--depth", kind, views=written(f"{kind}_depth", of))
                self.assertLess(error, 0.5 * plain)
                self.assertGreater(other, psnr - (0.3 if kind == "metric" else 1))
                with open(self.path(f"{kind}.fit.json")) as f:
                    self.assertEqual(json.load(f)["settings"]["depth"], kind)
        self.refuses(2, "--depth-weight needs --depth", *self.fit("--depth-weight", 1))
        self.refuses(1, ["--depth", "no frame names one"], *self.fit("--depth", "metric"))
        self.refuses(1, ["--depth", "only a COLMAP model"], *self.fit("--depth", "points"))
        self.refuses(2, ["--depth", "mcmc"], *self.fit("--depth", "metric", "--strategy", "error", views="metric_depth.json"))

    def test_what_is_refused(self):
        self.refuses(2, "--object and --scene exclude each other", *self.fit("--object", "--scene"))
        self.refuses(2, ["--center", "--scale", "whole scene"], *self.fit("--scene", "--scale", 2))
        for frame in self.list["frames"]:
            frame["transform_matrix"] = self.list["frames"][0]["transform_matrix"]
        self.write_list("one.json", self.list)
        self.refuses(1, ["one place", "one.json"], *self.fit("--scene", views="one.json"))
        self.assertFalse(os.path.exists(self.path("out.ply")))


if __name__ == "__main__":
    unittest.main()
