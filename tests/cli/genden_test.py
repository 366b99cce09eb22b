"""GenDen's network, and VS-Splat's with the densifier, on the command line: init, reconstruct, train and evaluate."""
import json
import os
import pathlib
import shutil

import support
import train_support

NETWORKS = (("genden", "micro"), ("vsplat+genden", "tiny"))


class Genden(support.Case):
    def made(self, system, size):
        path = self.path(f"{system}-{size}.safetensors")
        self.succeeds("init", size, "--system", system, "--seed", 3, "--output", path)
        return path

    def test_init(self):
        for system, size in NETWORKS + (("genden", "small"), ("vsplat+genden", "small")):
            with self.subTest(system=system, size=size):
                result = json.loads(self.succeeds("weights", "info", self.made(system, size), "--json")[0])
                self.assertEqual(result["system"], system)
                self.assertIn("densify.top_k", result["config"])
                self.succeeds("weights", "verify", self.path(f"{system}-{size}.safetensors"))
        self.refuses(2, ["micro", "paper, small, tiny"], "init", "micro", "--system", "vsplat+genden", "--seed", 1, "--output", self.path("none"))
        self.refuses(2, ["paper", "published"], "init", "paper", "--system", "genden", "--seed", 1, "--output", self.path("none"))

    def test_reconstruct_and_plan(self):
        for system, size in NETWORKS:
            with self.subTest(system=system):
                model = self.made(system, size)
                plan = json.loads(self.succeeds("reconstruct", self.views, "--model", model, "--dry-run", "--json")[0])
                self.assertTrue(plan)
                scenes = [self.path(f"{system}-{i}.ply") for i in range(2)]
                for scene in scenes:
                    self.succeeds("reconstruct", self.views, "--model", model, "--output", scene)
                self.assertEqual(*(pathlib.Path(scene).read_bytes() for scene in scenes))
                self.succeeds("render", scenes[0], "--cameras", "orbit:1", "--size", "24x24", "--images", self.path(f"{system}-images"))


class GendenTrained(train_support.Case):
    def test_interrupted_and_whole_give_the_same_bytes(self):
        for system, size in NETWORKS:
            with self.subTest(system=system):
                self.trains(system, size)

    def trains(self, system, size):
        def run(name):
            return f"{system}-{name}"

        config = self.config(model={"system": system, "base": size}, steps=4, sheet_every=4, checkpoint_every=1, keep_checkpoints=9)
        plan = json.loads(self.succeeds("train", config, "--dry-run", "--json")[0])
        self.assertTrue(plan)
        self.succeeds(*self.train(config, run("whole")))
        self.assertTrue(os.listdir(self.path(run("whole"), "sheets")))
        shutil.copytree(self.path(run("whole")), self.path(run("killed")))  # as if it had been killed after step 2
        for step in (3, 4):
            os.remove(self.path(run("killed"), f"checkpoint-{step:08d}.safetensors"))
        self.succeeds(*self.train(config, run("killed"), "--resume"))
        self.same_training(run("whole"), run("killed"), 4)
        model = self.path(run("whole"), "model.safetensors")
        self.assertEqual(json.loads(self.succeeds("weights", "info", model, "--json")[0])["system"], system)
        scores = json.loads(self.succeeds("evaluate", self.solids, "--model", model, "--json")[0])
        self.assertEqual(len(scores["objects"]), 3)
        self.assertIsInstance(scores["mean"]["psnr"], float)
        self.refuses(1, "fine_after", *self.train(self.config("fine.json", model={"system": system, "base": size}, fine_after=1), "none"))


if __name__ == "__main__":
    support.main()
