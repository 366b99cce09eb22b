"""vsplat fit: scenes fitted to pictures; its reports, what it refuses, and equal bytes in two runs."""
import csv
import json
import math
import os
import pathlib
import random
import shutil
import signal
import subprocess
import time

import fit_case
import support

KILLS = int(os.environ.get("VSPLAT_KILLS", "2"))
RESULT = ["output", "gaussians", "steps", "measured_on", "start", "result", "held_out", "returned", "claimed", "outliers", "seconds"]
NUMERICS = ["tuning", "precision", "switched_off"]


def quaternion(r):
    """Returns w x y z of a rotation."""
    w = math.sqrt(max(0.0, 1 + r[0][0] + r[1][1] + r[2][2])) / 2
    x = math.copysign(math.sqrt(max(0.0, 1 + r[0][0] - r[1][1] - r[2][2])) / 2, r[2][1] - r[1][2])
    y = math.copysign(math.sqrt(max(0.0, 1 - r[0][0] + r[1][1] - r[2][2])) / 2, r[0][2] - r[2][0])
    z = math.copysign(math.sqrt(max(0.0, 1 - r[0][0] - r[1][1] + r[2][2])) / 2, r[1][0] - r[0][1])
    return w, x, y, z


class Fit(fit_case.FitCase):
    def test_pictures_held_out_get_better_and_the_json_says_how_much(self):
        result = self.json_of(*self.fit("--holdout", 1, "--steps", 60, "--log", self.path("log.csv"), "--sheet", self.path("sheet.png")))
        self.assertEqual(list(result), RESULT[:-1] + ["log", "sheet", "page", "settings"] + NUMERICS + RESULT[-1:])
        self.assertEqual(len(result["measured_on"]), 1)
        self.assertEqual(result["returned"], "fitted")
        self.assertEqual(result["claimed"], False)  # a scene from a file may have seen every picture
        self.assertGreater(result["result"]["psnr"], result["start"]["psnr"] + 1)
        self.assertEqual(result["outliers"], [])
        self.assertTrue(pathlib.Path(self.path("out.ply")).read_bytes().startswith(b"ply\n"))
        rows = list(csv.DictReader(open(self.path("log.csv"))))
        self.assertEqual([int(row["step"]) for row in rows], list(range(1, 61)))
        self.assertEqual({row["phase"] for row in rows}, {"fitting"})
        self.assertLess(float(rows[-1]["loss"]), float(rows[0]["loss"]))
        self.assertAlmostEqual(max(float(row["psnr"]) for row in rows if row["psnr"]), result["result"]["psnr"], 2)
        (picture,) = result["held_out"]
        self.assertEqual([picture["name"]], result["measured_on"])
        self.assertAlmostEqual(picture["psnr"], result["result"]["psnr"], 2)
        self.assertAlmostEqual(picture["ssim"], result["result"]["ssim"], 3)
        self.assertGreaterEqual(picture["psnr_cc"], picture["psnr"])
        self.assertEqual(picture["psnr_cc"], result["result"]["psnr_cc"])
        self.assertNotIn("psnr_cc", result["start"])  # it is of the scene that is written
        self.assertEqual({row["psnr_cc"] for row in rows[:-1]}, {""})
        self.assertAlmostEqual(float(rows[-1]["psnr_cc"]), picture["psnr_cc"], 1)
        width, height, _ = support.read_png(self.path("sheet.png"))
        self.assertGreater(width, 4 * self.SIDE)
        self.assertLess(height, 2 * self.SIDE + 20)

    def test_the_picture_that_was_held_out_is_what_the_scene_is_measured_by(self):
        result = self.json_of(*self.fit("--holdout", "@2", "--steps", 40))
        self.assertEqual([os.path.basename(name) for name in result["measured_on"]], ["0002.png"])
        compared = self.json_of("render", self.path("out.ply"), "--cameras", os.path.join(self.photos, "transforms.json"), "--compare",
                             os.path.join(self.photos, "images"), "--quiet")
        self.assertAlmostEqual(compared["comparison"]["pictures"][2]["psnr"], result["result"]["psnr"], 1)

    def test_few_views_are_each_left_out_in_turn(self):
        result = self.json_of(*self.fit("--steps", 25, "--log", self.path("log.csv")))
        self.assertEqual(len(result["measured_on"]), 5)
        self.assertEqual(result["held_out"], [])  # in the end every view is fitted
        phases = [row["phase"] for row in csv.DictReader(open(self.path("log.csv")))]
        self.assertEqual(sorted(set(phases)), ["fitting"] + [f"leaving out {i} of 5" for i in range(1, 6)])
        self.assertIn(result["steps"], (0, 25))
        self.assertEqual(result["returned"], "fitted" if result["steps"] else "start")

    def test_the_start_is_returned_where_nothing_makes_it_better(self):
        self.succeeds(*self.fit("--holdout", "@0", "--steps", 150, output="good.ply"))
        # Fits to pictures with permuted colours, measured on an unchanged one.
        for name in sorted(os.listdir(os.path.join(self.photos, "images")))[1:]:
            path = os.path.join(self.photos, "images", name)
            width, height, data = support.read_png(path)
            step = len(data) // (width * height)
            rows = [[tuple(255 - v for v in data[step * (y * width + x):][:3]) for x in range(width)] for y in range(height)]
            support.write_png(path, width, height, rows)
        result = self.json_of(*self.fit("--holdout", "@0", "--steps", 30, start=self.path("good.ply")))
        self.assertEqual((result["returned"], result["steps"]), ("start", 0))
        self.assertLess(result["result"]["psnr"], result["start"]["psnr"])
        self.assertGreaterEqual(result["start"]["psnr_cc"], result["start"]["psnr"] - 0.01)
        camera = ("--cameras", os.path.join(self.photos, "transforms.json"), "--quiet", "--images")
        self.succeeds("render", self.path("good.ply"), *camera, self.path("a"))
        self.succeeds("render", self.path("out.ply"), *camera, self.path("b"))
        self.assertEqual(pathlib.Path(self.path("a", "0000.png")).read_bytes(), pathlib.Path(self.path("b", "0000.png")).read_bytes())

    def test_antialiasing_is_kept_by_the_file_and_obeyed_by_render(self):
        self.succeeds(*self.fit("--holdout", 1, "--steps", 20, "--antialias"))
        self.succeeds(*self.fit("--holdout", "none", "--steps", 5, start=self.path("out.ply"), output="more.ply"))
        for name in ("out.ply", "more.ply"):
            self.assertIn(b"\ncomment SplatRenderMode: mip\n", pathlib.Path(self.path(name)).read_bytes()[:500])
        drawn = {}
        for mode in ("auto", "on", "off"):
            self.succeeds("render", self.path("out.ply"), "--cameras", "orbit:1", "--size", "12x12", "--antialias", mode, "--images",
                          self.path(mode), "--quiet")
            drawn[mode] = pathlib.Path(self.path(mode, "0000.png")).read_bytes()
        self.assertEqual(drawn["auto"], drawn["on"])
        self.assertNotEqual(drawn["auto"], drawn["off"])

    def test_the_same_input_gives_the_same_bytes(self):
        more = ("--holdout", 1, "--steps", 30, "--seed", 7)
        for start in (self.ball, "random"):
            with self.subTest(start=start):
                scenes = []
                for name in ("a.ply", "b.ply"):
                    self.succeeds(*self.fit(*more, start=start, output=name), "--overwrite")
                    scenes.append(pathlib.Path(self.path(name)).read_bytes())
                self.assertEqual(scenes[0], scenes[1])
                self.succeeds(*self.fit(*more[:-1], 8, start=start, output="c.ply"), "--overwrite")
                self.assertNotEqual(scenes[0], pathlib.Path(self.path("c.ply")).read_bytes())

    def test_the_network_predicts_again_without_what_is_left_out(self):
        result = self.json_of(*self.fit("--steps", 25, "--model", self.model, start="network"))
        self.assertEqual(result["claimed"], True)
        self.assertEqual(len(result["measured_on"]), 5)
        _, err = self.succeeds("fit", self.photos, "--start", "network", "--model", self.model, "--output", self.path("b.ply"), "--steps", 25,
                               "--holdout", "@1", "--verbose")
        names = next(line for line in err.splitlines() if line.startswith("the network gets"))
        self.assertNotIn("001", names)
        _, err = self.succeeds("fit", self.photos, "--start", "network", "--model", self.model, "--output", self.path("c.ply"), "--steps", 25,
                               "--holdout", "@1", "--view-count", 3, "--verbose")
        names = next(line for line in err.splitlines() if line.startswith("the network gets"))
        self.assertEqual(names.count(","), 2, names)
        self.refuses(2, ["--view-count", "network"], *self.fit("--view-count", 3, "--overwrite"))

    def test_what_is_frozen_stays(self):
        self.succeeds(*self.fit("--holdout", "none", "--steps", 10, "--freeze", "means,scales,rotations,opacities"))
        def body(path):
            return pathlib.Path(path).read_bytes().partition(b"end_header\n")[2]
        count = len(body(self.ball)) // 56
        result = self.json_of("render", self.path("out.ply"), "--cameras", "orbit:1", "--images", self.path("x"), "--quiet")
        self.assertEqual(result["gaussians"], count)
        self.refuses(2, ["--freeze", "nothing is left"], *self.fit("--freeze", "means,scales,rotations,opacities,sh", "--overwrite"))

    def test_an_interrupt_ends_it_with_the_best_so_far(self):
        process = subprocess.Popen([support.VSPLAT, *map(str, self.fit("--holdout", 1, "--steps", 1000000))], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        try:
            process.wait(6)
            self.fail(process.stderr.read())
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(60), 130, process.stderr.read())
        self.assertTrue(pathlib.Path(self.path("out.ply")).read_bytes().startswith(b"ply\n"))
        self.assertIn("Stopped early", pathlib.Path(self.path("out.fit.html")).read_text())
        self.assertEqual(json.load(open(self.path("out.fit.json")))["figures"]["stopped"], True)

    def test_strategies_and_consolidation(self):
        """Growth needs 12 views: the two strategies give different scenes of the same size, and a consolidation a smaller one."""
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("many"), "--views", 12, "--size", self.SIDE, "--seed", 4)
        self.photos = self.path("many", "solid_0000")
        more = ("--steps", 120, "--max-gaussians", 90, "--holdout", "none")
        mcmc = self.json_of(*self.fit(*more, output="mcmc.ply"))
        error = self.json_of(*self.fit(*more, "--strategy", "error", output="error.ply"))
        for result in (mcmc, error):
            self.assertGreater(result["gaussians"], 60)
            self.assertLessEqual(result["gaussians"], 90)
        self.succeeds(*self.fit(*more, "--strategy", "mcmc", output="same.ply"))
        read = {name: pathlib.Path(self.path(name + ".ply")).read_bytes() for name in ("mcmc", "error", "same")}
        self.assertEqual(read["mcmc"], read["same"])
        self.assertNotEqual(read["mcmc"], read["error"])
        half = self.json_of(*self.fit(*more, "--consolidate", 0.5, "--log", self.path("log.csv"), output="half.ply"))
        self.assertEqual(half["steps"], 120)
        self.assertLessEqual(half["gaussians"], 45)
        self.assertGreater(half["gaussians"], 20)
        rows = list(csv.DictReader(open(self.path("log.csv"))))
        self.assertEqual([row["phase"] for row in rows], 90 * ["fitting"] + 30 * ["consolidating"])

    def test_poses_are_written_and_read_again(self):
        result = self.json_of(*self.fit("--holdout", "@0", "--steps", 30, "--poses", "--exposure"))
        self.assertEqual(result["poses"], self.path("out.poses.json"))
        cameras, listed = json.load(open(result["poses"])), json.load(open(os.path.join(self.photos, "transforms.json")))["frames"]
        self.assertEqual([c["file"] for c in cameras], [frame["file_path"] for frame in listed])
        self.assertEqual({(c["w"], c["h"]) for c in cameras}, {(self.SIDE, self.SIDE)})
        for i, (camera, frame) in enumerate(zip(cameras, listed)):
            z = [-frame["transform_matrix"][k][2] for k in range(3)]  # OpenGL looks along -z
            agree = sum(a * b for a, b in zip(camera["w2c"][2][:3], z))
            self.assertGreater(agree, 0.999)
            self.assertEqual(agree > 1 - 1e-12, i == 0, i)  # held-out views do not move
        self.succeeds("render", self.path("out.ply"), "--cameras", result["poses"], "--images", self.path("x"))

    def test_resumed_it_ends_with_the_same_bytes(self):
        more = ("--holdout", 1, "--steps", 250, "--seed", 3)
        self.succeeds(*self.fit(*more))
        kept = ("--checkpoint", self.path("state"))
        process = subprocess.Popen([support.VSPLAT, *map(str, self.fit(*more, *kept, output="again.ply"))])
        while process.poll() is None and not os.path.exists(self.path("state", "refinement.safetensors")):
            pass
        process.kill()
        process.wait()
        self.refuses(2, ["--resume", "state"], *self.fit(*more, *kept, output="again.ply"))
        resumed = [argument for argument in self.fit(*more, *kept, "--resume", output="again.ply") if argument != "--quiet"]
        _, said = self.succeeds(*resumed, "--overwrite")
        self.assertIn("1 picture that it was not fitted to:", said)  # nothing was left out in turn
        self.assertRegex(pathlib.Path(self.path("again.fit.html")).read_text(), r"resumed after step \d+")
        self.assertNotIn("resumed after", pathlib.Path(self.path("out.fit.html")).read_text())
        self.assertEqual(pathlib.Path(self.path("out.ply")).read_bytes(), pathlib.Path(self.path("again.ply")).read_bytes())
        self.refuses(2, "--resume needs --checkpoint", *self.fit("--resume", output="x.ply"))

    def test_killed_at_any_moment(self):
        """With each view left out in turn, poses and exposure: results that are lost are computed again, with the same bytes."""
        more = ("--steps", 50, "--seed", 3, "--poses", "--exposure")
        begun = time.monotonic()
        self.succeeds(*self.fit(*more))
        seconds = time.monotonic() - begun
        moments = random.Random(7)
        # A killed process may have written the scene already.
        again = self.fit(*more, "--checkpoint", self.path("state"), "--resume", "--overwrite", output="again.ply")
        kills = 0
        while kills < KILLS:
            process = subprocess.Popen([support.VSPLAT, *map(str, again)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            try:
                err = process.communicate(timeout=moments.uniform(0, seconds))[1]
                self.assertEqual(process.returncode, 0, err)
                shutil.rmtree(self.path("state"))  # it had finished: begin again
                for name in ("again.ply", "again.poses.json", "again.fit.json", "again.fit.html"):
                    os.remove(self.path(name))
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.communicate()
                kills += 1
        self.succeeds(*again)
        for name in ("out.ply", "out.poses.json"):
            self.assertEqual(pathlib.Path(self.path(name)).read_bytes(), open(self.path(name.replace("out", "again")), "rb").read())
        self.assertFalse([name for name in os.listdir(self.path("state")) if name.endswith(".tmp")])

    def test_what_the_network_makes_stays_whatever_ends_refining(self):
        """reconstruct --refine writes the network's scene first: it exists after a kill, an interrupt or a timeout."""
        def begun(name):
            process = subprocess.Popen([support.VSPLAT, "reconstruct", self.photos, "--model", self.model, "--output", self.path(name), "--refine",
                                        "--refine-steps", "100000", "--render", "orbit:2", "--images", self.path("pictures")],
                                       stderr=subprocess.PIPE, text=True)
            while process.poll() is None and not os.path.exists(self.path(name)):
                time.sleep(0.01)
            return process
        self.succeeds("reconstruct", self.photos, "--model", self.model, "--output", self.path("network.ply"), "--quiet")
        process = begun("killed.ply")
        process.kill()
        process.communicate()
        self.assertEqual(pathlib.Path(self.path("killed.ply")).read_bytes(), pathlib.Path(self.path("network.ply")).read_bytes())
        process = begun("stopped.ply")
        process.send_signal(signal.SIGINT)
        err = process.communicate(timeout=120)[1]
        self.assertEqual(process.returncode, 130, err)
        self.assertIn("stopped.ply is written, its pictures are not", err)
        self.succeeds("render", self.path("stopped.ply"), "--cameras", "orbit:1", "--images", self.path("x"), "--quiet")
        self.assertFalse(os.path.exists(self.path("pictures")))
        result = self.json_of("reconstruct", self.photos, "--model", self.model, "--output", self.path("timed.ply"), "--refine", "--refine-steps", 100000,
                         "--refine-time", 2, "--quiet")
        self.assertLess(result["seconds"], 60)
        self.refuses(2, "--time needs --refine", "reconstruct", self.photos, "--model", self.model, "--output", self.path("x.ply"), "--time", 2)
        self.refuses(2, "--refine-time is", "reconstruct", self.photos, "--model", self.model, "--output", self.path("x.ply"), "--refine", "--time", 0)

    def test_the_cube_comes_from_the_points_that_are_read(self):
        """A list without a cube, beside a COLMAP model in another world (as nerfstudio leaves them)."""
        path = os.path.join(self.photos, "transforms.json")
        views = json.load(open(path))
        del views["aabb_center"], views["aabb_half"]
        model = os.path.join(self.photos, "colmap", "sparse", "0")
        os.makedirs(model)
        def write(name, lines):
            with open(os.path.join(model, name), "w") as f:
                f.write("".join(line + "\n" for line in lines))
        # COLMAP's world: three times as large, and moved. A camera's matrix loses the flip of axes; its rotation becomes a quaternion.
        lines = []
        for i, frame in enumerate(views["frames"]):
            m = frame["transform_matrix"]
            r = [[m[k][0], -m[k][1], -m[k][2]] for k in range(3)]  # camera to world, y down, z forward
            at = [3 * m[k][3] + (5, 0, -2)[k] for k in range(3)]
            t = [-sum(r[k][axis] * at[k] for k in range(3)) for axis in range(3)]
            lines.append(" ".join(map(repr, [i + 1, *quaternion([[r[k][axis] for k in range(3)] for axis in range(3)]), *t])) +
                         f" 1 {os.path.basename(frame['file_path'])}")
            lines.append("")
        write("images.txt", lines)
        side, angle = self.SIDE, views["frames"][0].get("camera_angle_x", views.get("camera_angle_x", 0.7))
        focal = views.get("fl_x", views["frames"][0].get("fl_x", 0.5 * side / math.tan(angle / 2)))
        write("cameras.txt", [f"1 PINHOLE {side} {side} {focal} {focal} {side / 2} {side / 2}"])
        spots = [(0.3 * math.sin(i), 0.3 * math.cos(2.3 * i), 0.3 * math.sin(5.1 * i)) for i in range(200)]
        write("points3D.txt", [f"{i + 1} {3 * x + 5} {3 * y} {3 * z - 2} 100 120 140 0.5 1 0 2 0 3 0" for i, (x, y, z) in enumerate(spots)])
        json.dump(views, open(path, "w"))
        _, err = self.succeeds("fit", self.photos, "--start", "points", "--output", self.path("points.ply"), "--holdout", 1, "--steps", 10)
        self.assertRegex(err, r"(19[5-9]|200) of the 200 points lie in the object's cube")
        centre = [float(v) for v in err.split("the object's cube: centre (")[1].split(")")[0].split(",")]
        self.assertLess(max(map(abs, centre)), 0.1, err)
        self.assertIn("of the 200 points, the dense ones", err)

    def test_time_is_kept(self):
        result = self.json_of(*self.fit("--holdout", 1, "--steps", 1000000, "--time", 1))
        self.assertLess(result["seconds"], 30)

    def opaque(self):
        """Puts the pictures on blue, without alpha. Returns their paths."""
        paths = sorted(pathlib.Path(self.photos).rglob("*.png"))
        for path in paths:
            width, height, pixels = support.read_png(path)
            self.assertEqual(len(pixels), 4 * width * height)
            rows = [[tuple((pixels[i + c] * pixels[i + 3] + (50, 100, 230)[c] * (255 - pixels[i + 3])) // 255 for c in range(3))
                     for i in range(4 * width * y, 4 * width * (y + 1), 4)] for y in range(height)]
            support.write_png(path, width, height, rows)
        return paths

    def same_figures(self, result):
        """The scene that is written, compared with its pictures once more, has the figures of the fit."""
        written = result["start" if result["returned"] == "start" else "result"]
        for name, places in (("psnr", 1), ("ssim", 2)):
            self.assertAlmostEqual(sum(picture[name] for picture in result["held_out"]) / len(result["held_out"]), written[name], places, name)

    def test_a_sky_is_written_as_gaussians(self):
        self.opaque()
        held = ("--holdout", 1, "--steps", 150, "--background")
        result = self.json_of(*self.fit(*held, "sky"))
        self.assertGreater(result["gaussians"], 10000)
        self.assertAlmostEqual(result["over_sky"]["psnr"], result["result"]["psnr"], delta=1)
        self.assertGreater(result["result"]["psnr"], result["start"]["psnr"] + 3)
        self.same_figures(result)
        self.succeeds("render", self.path("out.ply"), "--cameras", "orbit:1", "--size", "24x24", "--images", self.path("drawn"), "--background", "black",
                      "--quiet")
        corner = support.read_png(next(pathlib.Path(self.path("drawn")).glob("*.png")))[2][:3]
        self.assertGreater(corner[2], corner[0] + 30, "the sky is blue")
        for behind in ("random", "#3264e6"):
            result = self.json_of(*self.fit(*held, behind, "--overwrite"))
            self.assertLess(result["gaussians"], 10000)
            self.assertNotIn("over_sky", result)
            self.same_figures(result)

    def test_what_masks_leave_out_takes_no_part(self):
        masks = pathlib.Path(self.photos, "masks")
        paths = self.opaque()
        masks.mkdir()
        for path in paths:
            width, height, pixels = support.read_png(path)
            half = [[tuple(pixels[3 * (y * width + x):][:3]) if x < width // 2 else (255, 0, 0) for x in range(width)] for y in range(height)]
            support.write_png(path, width, height, half)
            support.write_png(masks / path.name, width, height, [[(255 * (x < width // 2),) * 3 for x in range(width)]] * height)
        given = ("--holdout", 1, "--steps", 60, "--masks", "ignore", "--background", "#3264e6", "--overwrite")
        left = self.json_of(*self.fit(*given))
        whole = self.json_of(*self.fit(*given[:4], *given[6:], "--masks", "object"))
        both = self.json_of(*self.fit(*given, "--invert-masks"))
        self.assertGreater(left["result"]["psnr"], left["start"]["psnr"] + 1)
        self.assertGreater(left["start"]["psnr"], both["start"]["psnr"] + 5, "the red half is not measured")
        self.assertNotEqual(left["start"], whole["start"])
        for result in (left, whole, both):
            self.same_figures(result)

    def test_what_is_refused(self):
        self.refuses(2, ["--background is sky", "5 of the 5", "--masks"], *self.fit("--background", "sky"))
        self.refuses(2, ["--background", "skyish"], *self.fit("--background", "skyish"))
        self.refuses(2, ["--masks", "none of the 5"], *self.fit("--masks", "ignore"))
        self.refuses(2, ["--invert-masks", "none of the 5"], *self.fit("--invert-masks"))
        self.refuses(2, "--output", "fit", self.photos, "--start", self.ball)
        self.refuses(1, "nowhere.ply", *self.fit(start=self.path("nowhere.ply")))
        self.refuses(2, ["--output", ".ply", ".spz"], *self.fit(output="out.obj"))
        self.refuses(2, ["--holdout nobody", "no such view"], *self.fit("--holdout", "nobody"))
        self.refuses(2, ["--views nobody", "no such view"], *self.fit("--views", "@0,nobody"))
        self.refuses(2, "every view is held out", *self.fit("--holdout", "@0,@1,@2,@3,@4"))
        self.refuses(2, ["--holdout", "1 to 4"], *self.fit("--holdout", 5))
        self.refuses(2, ["--holdout", "not among"], *self.fit("--views", "@0,@1", "--holdout", "@3"))
        self.refuses(2, ["--steps", "soon"], *self.fit("--steps", "soon"))
        self.refuses(2, ["--size", "big"], *self.fit("--size", "big"))
        self.refuses(2, ["--freeze", "feet"], *self.fit("--freeze", "feet"))
        self.refuses(2, ["--strategy", "mcmc"], *self.fit("--strategy", "luck"))
        for share in ("0", "1.01", "-0.5", "nan", "half"):
            self.refuses(2, ["--consolidate", share], *self.fit("--consolidate=" + share))
        self.refuses(2, ["12 views", "5 are used"], *self.fit("--consolidate", 0.5))
        self.refuses(2, "--sh", *self.fit("--sh", 4))
        self.refuses(2, "--model is for --start network", *self.fit("--model", self.model))
        self.refuses(2, ["--sheet", ".png"], *self.fit("--sheet", self.path("s.jpg")))
        self.refuses(1, "no COLMAP model", *self.fit(start="points"))
        open(self.path("out.ply"), "w").write("mine")
        self.refuses(1, ["out.ply", "--overwrite"], *self.fit())
        self.refuses(2, "is read", *self.fit("--overwrite", output="ball.ply"))
        err = self.refuses(1, ["memory", "--max-memory"], *self.fit("--max-memory", "0.00005", "--overwrite"))
        self.assertNotIn("vsplat_", err)
        support.write_scene(self.path("empty.ply"), [])
        self.refuses(1, "no Gaussian", *self.fit("--overwrite", start=self.path("empty.ply")))

    def test_dry_run(self):
        result = self.json_of("fit", self.photos, "--start", self.ball, "--dry-run")
        self.assertEqual([plan["fits"] for plan in result], [True])
        self.assertIn("24 x 24", result[0]["what"])
        self.assertNotIn("steps", result[0])  # views are left out in turn to find it
        self.assertGreater(result[0]["seconds"], 0)
        text = self.succeeds("fit", self.photos, "--start", self.ball, "--steps", 30, "--holdout", "none", "--dry-run")[0]
        self.assertRegex(text, r"time +about .* for 30 steps")
        more = self.json_of("fit", self.photos, "--start", self.ball, "--dry-run", "--max-gaussians", 100000)
        self.assertGreater(more[0]["peak_bytes"], result[0]["peak_bytes"])
        self.assertEqual(len(self.json_of("fit", self.photos, "--start", "network", "--model", self.model, "--dry-run")), 2)
        self.assertEqual(os.path.exists(self.path("out.ply")), False)


if __name__ == "__main__":
    support.main()
