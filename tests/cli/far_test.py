"""Worlds far from their origin, as with georeferenced photographs: results are as good as at the origin."""
import json
import math
import os
import pathlib
import shutil

import support

DISTANCES = (1e3, 1e5, 1e7)  # edges of the cube
LEAST = 60                        # dB against the scene at the origin
# Uses all views: if two cameras are equally far from their middle, rounding would choose differently elsewhere.
VIEWS = ("--views", "@0,@1,@2,@3")


class Far(support.Case):
    SIDE = 32

    def setUp(self):
        super().setUp()
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("set"), "--views", 5, "--size", self.SIDE, "--seed", 4)
        self.here = self.moved(0)

    def moved(self, distance, name="world"):
        """The set in a world whose origin is so far away along each axis. Returns its folder."""
        folder = self.path(f"{name}_{distance:g}", "solid")
        if not os.path.isdir(folder):
            shutil.copytree(self.path("set", "solid_0000"), folder)
            path = os.path.join(folder, "transforms.json")
            data = json.load(open(path))
            data["aabb_center"] = [c + distance for c in data.get("aabb_center", [0, 0, 0])]
            self.edge = 2 * data.setdefault("aabb_half", 0.5)
            for frame in data["frames"]:
                for row in frame["transform_matrix"][:3]:
                    row[3] += distance
            json.dump(data, open(path, "w"))
        return folder

    def json_of(self, *arguments):
        return json.loads(self.succeeds(*arguments, "--json", "--quiet")[0])

    def pictures(self, scene, cameras, name):
        self.succeeds("render", scene, "--cameras", cameras, "--images", self.path(name), "--quiet")
        return b"".join(support.read_png(self.path(name, file))[2] for file in sorted(os.listdir(self.path(name))))

    def hold(self, what, distance, there, here):
        got = support.psnr(there, here)
        print(f"{what}, {distance:g} edges away: {got:.1f} dB")
        self.assertGreaterEqual(got, LEAST, (what, distance))

    def offset_of(self, scene):
        head = pathlib.Path(scene).read_bytes().split(b"end_header")[0].decode()
        found = [line.split()[3:] for line in head.splitlines() if line.startswith("comment vsplat offset")]
        return [float(v) for v in found[0]] if found else None

    def test_reconstruct_and_the_file_that_it_writes(self):
        for distance in (0, *DISTANCES):
            views, scene = self.moved(distance), self.path(f"{distance:g}.ply")
            drawn = self.path(f"drawn_{distance:g}")
            result = self.json_of("reconstruct", views, *VIEWS, "--model", self.model, "--output", scene, "--render", views, "--images", drawn)
            beside = self.path(f"{distance:g}.offset.json")
            if distance <= 1e3:
                self.assertNotIn("offset", result)
                self.assertIsNone(self.offset_of(scene))
                self.assertFalse(os.path.exists(beside))
            else:
                self.assertEqual(result["offset"], result["center"])
                self.assertEqual(result["offset_file"], beside)
                self.assertEqual(self.offset_of(scene), result["offset"])
                self.assertEqual(json.load(open(beside)), {"scene": f"{distance:g}.ply", "offset": result["offset"]})
            got = {"reconstruct": b"".join(support.read_png(os.path.join(drawn, file))[2] for file in sorted(os.listdir(drawn))),
                   "the file, by its cameras": self.pictures(scene, views, f"file_{distance:g}"),
                   "the file, by an orbit": self.pictures(scene, "orbit:3", f"orbit_{distance:g}")}
            if distance == 0:
                at_origin = got
            for what in got:
                self.hold(what, distance, got[what], at_origin[what])
        # Written cameras are in the world.
        self.succeeds("render", scene, "--cameras", "orbit:3", "--write-cameras", self.path("orbit.json"), "--quiet")
        self.hold("the file, by cameras that were written", distance, self.pictures(scene, self.path("orbit.json"), "written"), got["the file, by an orbit"])

    def test_the_cube_may_be_asked_for_or_found(self):
        for how in (lambda d: ("--center", f"{d},{d},{d}", "--scale", self.edge), lambda d: ("--auto-frame",)):
            for distance in (0, 1e7):
                data = json.load(open(os.path.join(self.moved(distance), "transforms.json")))
                data.pop("aabb_center"), data.pop("aabb_half")
                json.dump(data, open(os.path.join(self.moved(distance), "transforms.json"), "w"))
                self.succeeds("reconstruct", self.moved(distance), *VIEWS, "--model", self.model, "--output", self.path("out.ply"), "--overwrite", "--quiet",
                              *how(distance))
                got = self.pictures(self.path("out.ply"), self.moved(distance), "pictures")
                shutil.rmtree(self.path("pictures"))
                shutil.rmtree(os.path.dirname(self.moved(distance)))
                if distance == 0:
                    at_origin = got
            self.hold(str(how(distance)[0]), distance, got, at_origin)

    def test_fit(self):
        for start in ("network", "random", "scene"):
            for distance in (0, 1e7):
                views, scene = self.moved(distance), self.path(f"{start}_{distance:g}.ply")
                first = self.path(f"network_{distance:g}.ply") if start == "scene" else start
                more = ("--model", self.model, "--view-count", 4) if start == "network" else ()
                result = self.json_of("fit", views, "--start", first, *more, "--holdout", 1, "--steps", 20, "--poses", "--output", scene)
                self.assertEqual("offset" in result, distance > 0)
                got = self.pictures(scene, views, f"{start}_{distance:g}")
                if distance == 0:
                    at_origin, scores = got, result
                self.hold(f"fit --start {start}", distance, got, at_origin)
                for key in ("start", "result"):
                    self.assertAlmostEqual(result[key]["psnr"], scores[key]["psnr"], 2)
                # The corrected cameras are in the world, too.
                if os.path.exists(self.path(f"{start}_{distance:g}.poses.json")):
                    poses = json.load(open(self.path(f"{start}_{distance:g}.poses.json")))
                    self.assertLess(abs(math.hypot(*(row[3] for row in poses[0]["w2c"][:3])) / max(distance * math.sqrt(3), 1) - 1), 0.5 if distance else 9)

    def test_evaluation(self):
        for more in ((), ("--refine",)):
            for distance in (0, 1e7):
                mean = self.json_of("evaluate", self.moved(distance), "--model", self.model, *more)["mean"]
                if distance == 0:
                    at_origin = mean
                print(f"evaluate {' '.join(more)}, {distance:g} edges away: {mean['psnr']} dB")
                self.assertAlmostEqual(mean["psnr"], at_origin["psnr"], 2)

    def test_it_is_said_and_expected_like_every_output(self):
        far = self.moved(1e6)
        reconstruct = lambda views, *more: ("reconstruct", views, "--model", self.model, "--output", self.path("scene.ply"), *more)
        _, said = self.succeeds(*reconstruct(far))
        self.assertIn("scene.offset.json", said)
        self.assertIn("relative to (1000000, 1000000, 1000000)", said)
        os.remove(self.path("scene.ply"))
        self.refuses(1, ["scene.offset.json exists", "--overwrite"], *reconstruct(far))
        self.refuses(1, ["scene.offset.json exists", "--overwrite"], *reconstruct(self.here))
        # A scene in the world has no offset file: an earlier one would misplace it.
        self.succeeds(*reconstruct(self.here, "--overwrite"))
        self.assertFalse(os.path.exists(self.path("scene.offset.json")))
        views = shutil.copy(os.path.join(far, "transforms.json"), os.path.join(far, "one.offset.json"))
        self.refuses(2, "cannot be the output", "reconstruct", views, "--model", self.model, "--output", os.path.join(far, "one.ply"), "--overwrite")

    def test_a_file_of_floats_far_away_is_fitted_about_its_cube(self):
        """Precision that the file's floats have lost stays lost, but no more is."""
        spots = [(1e5 + 0.25 * math.sin(i), 1e5 + 0.25 * math.cos(2.3 * i), 1e5 + 0.25 * math.sin(5.1 * i)) for i in range(60)]
        support.write_scene(self.path("ball.ply"), [(at, (0.5, 0.5, 0.5), 0.06, 0.7) for at in spots])
        result = self.json_of("fit", self.moved(1e5), "--start", self.path("ball.ply"), "--holdout", 1, "--steps", 20, "--output", self.path("out.ply"))
        self.assertEqual(result["offset"], [1e5] * 3)


if __name__ == "__main__":
    support.main()
