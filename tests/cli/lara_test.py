"""LaRa's network on the command line: what works for VS-Splat's works for it, chosen by the model file's `system`; and its surfel scenes."""
import json
import os
import pathlib
import shutil
import struct

import support
import train_support


def header_of(path):
    return pathlib.Path(path).read_bytes().split(b"end_header\n")[0].decode()


class Lara(support.Case):
    def setUp(self):
        super().setUp()
        self.lara = self.path("lara.safetensors")
        self.succeeds("init", "micro", "--system", "lara", "--seed", 3, "--output", self.lara)

    def scene(self):
        self.succeeds("reconstruct", self.views, "--model", self.lara, "--output", self.path("scene.ply"))
        return self.path("scene.ply")

    def test_init(self):
        result = json.loads(self.succeeds("weights", "info", self.lara, "--json")[0])
        self.assertEqual((result["system"], result["config"]["image"], result["config"]["kind"]), ("lara", 12, "surfel"))
        self.assertEqual(result["parameters"], 9390)
        self.succeeds("weights", "verify", self.lara)
        again = self.path("again.safetensors")
        self.succeeds("init", "micro", "--system", "lara", "--seed", 3, "--output", again)
        self.assertEqual(pathlib.Path(again).read_bytes(), pathlib.Path(self.lara).read_bytes())
        self.succeeds("init", "tiny", "--system", "lara", "--seed", 3, "--set", "kind=gaussian", "--set", "primitives=1", "--output", self.path("g.safetensors"))
        self.refuses(2, ["paper", "published"], "init", "paper", "--system", "lara", "--seed", 1, "--output", self.path("none"))
        self.refuses(2, ["published", "paper"], "init", "published", "--seed", 1, "--output", self.path("none"))
        self.refuses(2, "fine_count", "init", "micro", "--system", "lara", "--seed", 1, "--set", "fine_count=2", "--output", self.path("none"))
        self.refuses(2, "vsplat", "init", "micro", "--system", "laura", "--seed", 1, "--output", self.path("none"))

    def test_reconstruct_plan_and_profile(self):
        plan = json.loads(self.succeeds("reconstruct", self.views, "--model", self.lara, "--dry-run", "--json")[0])
        self.assertTrue(plan)
        self.succeeds("reconstruct", self.views, "--model", self.lara, "--output", self.path("p.ply"), "--profile", self.path("p.json"))
        profile = open(self.path("p.json")).read()
        for stage in ("encoder", "modulation", "lifting", "volume", "heads", "selection", "sort", "rasterize", "refinement"):
            self.assertIn(f'"{stage}', profile)
        for kernel in ("rasterize_surfels", "cross_attention", "sample_points"):
            self.assertIn(kernel, profile)

    def test_stages_of_more_primitives_than_come_at_a_time(self):
        """The dump contains all of them."""
        many = self.path("many.safetensors")
        self.succeeds("init", "tiny", "--system", "lara", "--seed", 3, "--set", "volume=15", "--output", many)
        result = json.loads(self.succeeds("reconstruct", self.views, "--model", many, "--output", self.path("many.ply"), "--dump", self.path("dump"), "--json")[0])
        with open(self.path("dump", "stages.safetensors"), "rb") as f:
            header = json.loads(f.read(struct.unpack("<Q", f.read(8))[0]))
        self.assertGreater(result["gaussians"], 16384)
        self.assertEqual(header["stage.fine.samples"]["shape"], [result["gaussians"], result["views"], 8])
        self.assertEqual(header["stage.fine.output"]["shape"][0], result["gaussians"])

    def test_a_scene_of_surfels_is_drawn_as_it_was(self):
        self.succeeds("reconstruct", self.views, "--model", self.lara, "--output", self.path("scene.ply"), "--render", "orbit:3", "--images", self.path("once"),
                      "--size", "48x32", "--write-cameras", self.path("cameras.json"))
        self.assertNotIn("scale_2", header_of(self.path("scene.ply")))
        self.succeeds("render", self.path("scene.ply"), "--cameras", self.path("cameras.json"), "--images", self.path("again"), "--size", "48x32", "--turntable", self.path("t.webp"),
                      "--sheet", self.path("s.png"))
        for name in sorted(os.listdir(self.path("once"))):
            first, second = (support.read_png(self.path(folder, name))[2] for folder in ("once", "again"))
            self.assertGreater(support.psnr(first, second), 60, name)
            self.assertLess(min(first), 250, "nothing is drawn")
        self.succeeds("render", self.path("scene.ply"), "--cameras", self.path("cameras.json"), "--size", "48x32", "--compare", self.path("again"))
        plan = json.loads(self.succeeds("render", self.path("scene.ply"), "--cameras", "orbit:3", "--size", "48x32", "--dry-run", "--json")[0])
        self.assertTrue(plan)

    def test_damaged_surfels(self):
        data = pathlib.Path(self.scene()).read_bytes()
        begin = data.index(b"end_header\n") + len("end_header\n")
        for size in (begin - 20, begin + 7, len(data) - 1):
            pathlib.Path(self.path("cut.ply")).write_bytes(data[:size])
            self.refuses(1, "cut.ply", "render", self.path("cut.ply"), "--cameras", "orbit:1", "--images", self.path("none"))
        bad = bytearray(data)
        columns = [line.split()[-1] for line in header_of(self.path("scene.ply")).splitlines() if line.startswith("property")]
        struct.pack_into("<f", bad, begin + 4 * columns.index("scale_1"), float("nan"))
        pathlib.Path(self.path("nan.ply")).write_bytes(bad)
        self.refuses(1, ["Gaussian 0", "scale_1", "--skip-bad"], "render", self.path("nan.ply"), "--cameras", "orbit:1", "--images", self.path("none"))
        self.succeeds("render", self.path("nan.ply"), "--cameras", "orbit:1", "--images", self.path("some"), "--skip-bad")

    def test_what_it_cannot_do_is_refused_by_name(self):
        self.refuses(2, "LaRa", "reconstruct", self.views, "--model", self.lara, "--output", self.path("none.ply"), "--selection-seed", 1)
        self.refuses(2, "surfels", "fit", self.views, "--start", self.scene(), "--output", self.path("none.ply"))


class LaraTrained(train_support.Case):
    MODEL = {"system": "lara", "base": "micro"}
    # The loss of random surfaces is large, so its weight is small.
    LOSS = {"fine_after": 3, "surface_after": 2, "distortion_weight": 10, "normal_weight": 0.02}

    def test_interrupted_and_whole_give_the_same_bytes(self):
        config = self.config(model=self.MODEL, **self.LOSS, checkpoint_every=1, keep_checkpoints=9)
        plan = json.loads(self.succeeds("train", config, "--dry-run", "--json")[0])
        self.assertTrue(plan)
        self.succeeds(*self.train(config, "whole"))
        for done in (1, 3):  # as if killed then: before and after the loss gets new terms
            run = f"killed-{done}"
            shutil.copytree(self.path("whole"), self.path(run))
            for step in range(done + 1, 7):
                os.remove(self.path(run, f"checkpoint-{step:08d}.safetensors"))
            self.succeeds(*self.train(config, run, "--resume"))
            self.same_training("whole", run, 6)
        result = json.loads(self.succeeds("weights", "info", self.path("whole", "model.safetensors"), "--json")[0])
        self.assertEqual(result["system"], "lara")
        # The trained model can be evaluated, and used with --init.
        scores = json.loads(self.succeeds("evaluate", self.solids, "--model", self.path("whole", "model.safetensors"), "--json", "--sheet", self.path("sheet.png"))[0])
        self.assertEqual(len(scores["objects"]), 3)
        for number in ("psnr", "psnr_coarse", "ssim", "selected"):
            self.assertIsInstance(scores["mean"][number], float)
        self.succeeds(*self.train(config, "after", "--init", self.path("whole", "model.safetensors")))
        other = self.config("other.json", model="micro")
        self.refuses(1, ["whole", "model"], *self.train(other, "none", "--init", self.path("whole", "model.safetensors")))

    def test_a_plan_is_of_the_stage_that_takes_the_most(self):
        """Stages that differ only in their length may differ in whether they have a second level."""
        def peak(*steps):
            config = self.config("stages.json", model=self.MODEL, **self.LOSS, warmup=1, stages=[{"steps": n} for n in steps])
            return json.loads(self.succeeds("train", config, "--dry-run", "--json", "--assume-selected", 1)[0])[0]["peak_bytes"]

        self.assertGreater(peak(6), peak(3))
        self.assertEqual(peak(3, 6), peak(6))

    def test_sheets_of_what_it_selects(self):
        self.succeeds(*self.train(self.config(model=self.MODEL, steps=2, sheet_every=2), "run"))
        self.assertTrue(os.listdir(self.path("run", "sheets")))
        self.refuses(2, "LaRa", *self.train(self.config(model=self.MODEL), "none", "--selection", __file__))


if __name__ == "__main__":
    support.main()
