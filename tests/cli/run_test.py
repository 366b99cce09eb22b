"""Requests that succeed: which files are written, where, and that they are consistent."""
import json
import os

import pathlib
import support


class Run(support.Case):
    def read(self, *parts):
        return pathlib.Path(self.path(*parts)).read_bytes()

    def test_everything_is_written(self):
        out, err = self.succeeds(*self.reconstruct(
            "--render", "orbit:3", "--images", self.path("new", "pictures"), "--size", "20x12", "--background", "0,0.5,1",
            "--write-views", self.path("seen"), "--write-selection", self.path("voxels.txt"), "--dump", self.path("dump"), "--profile",
            self.path("p.json"), "--trace", self.path("t.json"), "--json"))
        result = json.loads(out)
        self.assertEqual(result["views"], 2)
        self.assertEqual(result["images"], 3)
        self.assertIn("driver", err)
        self.assertEqual(sorted(os.listdir(self.path("new", "pictures"))), ["0000.png", "0001.png", "0002.png"])
        width, height, pixels = support.read_png(self.path("new", "pictures", "0000.png"))
        self.assertEqual((width, height), (20, 12))
        self.assertEqual(tuple(pixels[:3]), (0, 128, 255))              # nothing of the object reaches the corner
        self.assertIn(b"comment vsplat near 0.2", self.read("out.ply")[:500])
        profile = json.loads(self.read("p.json"))
        for field in ("device", "driver", "wall_s", "peak_bytes"):
            self.assertIn(field, profile)
        stages = {k["stage"] for k in profile["kernels"]}
        always = {"encoder", "modulation", "lifting", "volume", "heads", "selection", "project", "sort", "rasterize"}
        self.assertLessEqual(always, stages)
        self.assertLessEqual(stages, always | {"refinement", "decode", "splat", "transfer"})
        found = {(k["name"], k["stage"]) for k in profile["kernels"]}
        self.assertLessEqual({("project_cull", "project"), ("visible_count", "project"), ("project_forward", "project"), ("scan_blocks", "sort"),
                              ("tile_bin_count", "sort")}, found)
        self.assertEqual({stage for kernel, stage in found if kernel.startswith("rasterize")}, {"rasterize"})
        for kernel in profile["kernels"]:
            self.assertLessEqual({"name", "stage", "calls", "total_ns", "min_ns", "max_ns", "flops", "bytes", "timed_by"}, kernel.keys())
            self.assertIn(kernel["timed_by"], ("device", "host"))
        self.assertTrue(json.loads(self.read("t.json"))["traceEvents"])
        self.assertTrue(os.path.exists(self.path("dump", "stages.safetensors")))
        self.assertEqual(result["selected"], sum(line[:1].isdigit() for line in self.read("voxels.txt").decode().splitlines()))

    def test_what_was_written_is_input_again(self):
        self.succeeds(*self.reconstruct("--write-views", self.path("seen"), "--write-selection", self.path("voxels.txt")))
        again = ("reconstruct", self.path("seen"), "--model", self.model, "--output", self.path("again.ply"))
        self.succeeds(*again)
        self.assertEqual(self.read("out.ply"), self.read("again.ply"))
        self.succeeds(*again, "--selection", self.path("voxels.txt"), "--overwrite")
        self.assertEqual(self.read("out.ply"), self.read("again.ply"))

    def test_scene_read_again_looks_the_same(self):
        self.succeeds(*self.reconstruct("--render", self.views, "--images", self.path("a")))
        self.succeeds("render", self.path("out.ply"), "--cameras", self.views, "--images", self.path("b"))
        for i in range(3):
            first, second = (support.read_png(self.path(folder, f"{i:04d}.png")) for folder in "ab")
            self.assertEqual(first[:2], (16, 16))
            self.assertGreaterEqual(support.psnr(first[2], second[2]), 60)

    def test_up_goes_along_with_the_scene(self):
        """z-up cameras: the scene states its up direction, and render's orbit is upright without an option."""
        def z_up(data):
            for frame in data["frames"]:                                # y to z, z to -y
                x, y, z, w = frame["transform_matrix"]
                frame["transform_matrix"] = [x, [-v for v in z], y, w]
        ups = lambda name: [[-v for v in c["w2c"][1][:3]] for c in json.loads(self.read(name))]
        for expected, change in (((0, 1, 0), lambda data: None), ((0, 0, 1), z_up)):
            self.edit_views(change)
            out, _ = self.succeeds(*self.reconstruct("--json", "--overwrite", "--render", "orbit:3", "--write-cameras", self.path("own.json")))
            self.assertEqual(json.loads(out)["up"], list(expected))
            self.assertIn(b"comment vsplat up %d %d %d\n" % expected, self.read("out.ply")[:500])
            _, err = self.succeeds("render", self.path("out.ply"), "--cameras", "orbit:3", "--write-cameras", self.path("drawn.json"), "--overwrite")
            self.assertNotIn("--up", err)
            for up in ups("own.json") + ups("drawn.json"):
                self.assertGreater(sum(a * b for a, b in zip(up, expected)), 0.99)
        self.succeeds(*self.reconstruct("--overwrite", "--up", "0,-2,0"))   # the requested direction wins
        self.assertIn(b"comment vsplat up 0 -1 0\n", self.read("out.ply")[:500].replace(b"-0 ", b"0 "))

    def test_pictures_are_512_pixels_wide_unless_asked(self):
        self.succeeds(*self.reconstruct("--render", "orbit:1", "--images", self.path("x")))
        self.succeeds("render", self.path("out.ply"), "--cameras", "orbit:1", "--images", self.path("y"))
        for folder in "xy":
            self.assertEqual(support.read_png(self.path(folder, "0000.png"))[:2], (512, 512))
        for command in ("reconstruct", "render"):
            self.assertIn("512x512", self.succeeds(command, "--help")[0])

    def test_a_scene_without_up_says_so(self):
        support.write_scene(self.path("scene.ply"), [((0, 0, 0), (1, 0, 0), 0.1, 0.9)])
        drawn = ("render", self.path("scene.ply"), "--cameras", "orbit:1", "--write-cameras", self.path("c.json"), "--overwrite")
        self.assertIn("--up", self.succeeds(*drawn)[1])
        self.assertNotIn("--up", self.succeeds(*drawn, "--up", "0,0,1")[1])

    def test_kernels_are_prepared_once(self):
        cached = {"VSPLAT_CACHE_DIR": self.path("cache"), "POCL_CACHE_DIR": self.path("pocl")}
        os.makedirs(self.path("pocl"))
        said = [self.succeeds(*self.reconstruct("--overwrite"), env=cached)[1] for _ in range(2)]
        self.assertIn("preparing kernels", said[0])
        self.assertNotIn("preparing kernels", said[1])

    def test_no_voxel_is_an_empty_scene(self):
        open(self.path("none.txt"), "w").write("# none\n")
        out, err = self.succeeds(*self.reconstruct("--selection", self.path("none.txt"), "--render", "orbit:1", "--images", self.path("x"), "--json"))
        self.assertEqual(json.loads(out)["gaussians"], 0)
        self.assertIn("warning", err)
        self.assertEqual(set(support.read_png(self.path("x", "0000.png"))[2]), {255})

    def test_quiet_and_json(self):
        out, err = self.succeeds(*self.reconstruct("--quiet"))
        self.assertEqual((out, err), ("", ""))
        out, _ = self.succeeds("weights", "info", self.model, "--json")
        self.assertEqual(json.loads(out)["config"]["image"], 16)
        out, _ = self.succeeds("weights", "verify", self.model, "--json")
        self.assertEqual(json.loads(out)["hash"], "ok")

    def test_dry_run_writes_nothing(self):
        before = self.snapshot()
        out, _ = self.succeeds("reconstruct", self.views, "--model", self.model, "--dry-run", "--assume-selected", "0.3", "--json")
        plans = json.loads(out)
        self.assertEqual(len(plans), 2)
        self.assertTrue(0 < plans[0]["peak_bytes"] <= plans[1]["peak_bytes"])
        self.assertTrue(all(p["fits"] for p in plans))
        self.assertIn("encoder", [s["stage"] for s in plans[0]["stages"]])
        out, _ = self.succeeds(*self.reconstruct("--dry-run", "--max-memory", "0.0005", "--json"))
        self.assertFalse(json.loads(out)[0]["fits"])
        self.assertEqual(before, self.snapshot())

    def test_seed_gives_the_same_bytes(self):
        self.succeeds("init", "micro", "--seed", 3, "--output", self.path("twin.safetensors"))
        self.assertEqual(self.read("model.safetensors"), self.read("twin.safetensors"))
        self.succeeds(*self.reconstruct("--selection-seed", 5))
        first = self.read("out.ply")
        self.succeeds(*self.reconstruct("--selection-seed", 5, "--overwrite"))
        self.assertEqual(first, self.read("out.ply"))

    def test_exr(self):
        for raw in ([], ["--exr-raw"]):
            self.succeeds(*self.reconstruct("--render", "orbit:1", "--images", self.path("x"), "--format", "exr", *raw, "--overwrite"))
            self.assertEqual(self.read("x", "0000.exr")[:4], b"\x76\x2f\x31\x01")


if __name__ == "__main__":
    support.main()
