"""vsplat train as a user's shell sees it: what it writes, what ends it, and that it goes on as if nothing had happened."""
import json
import os
import random
import shutil
import signal
import subprocess
import time

import support
import train_support

KILLS = int(os.environ.get("VSPLAT_KILLS", "3"))


class Train(train_support.Case):
    # ---------------------------------------------------------------------------------------------------- what it does

    def test_what_is_written(self):
        config = self.config(steps=4, sheet_every=2, keep_checkpoints=1)
        out, err = self.succeeds(*self.train(config, "run", "--json", "--profile", self.path("p.json")))
        result = json.loads(out)
        self.assertEqual((result["step"], result["stopped"], result["bad"]), (4, False, 0))
        self.assertEqual(sorted(os.listdir(self.path("run"))),
                         ["checkpoint-00000004.safetensors", "config.json", "log.csv", "model.safetensors", "sheets"])
        self.assertEqual(sorted(os.listdir(self.path("run", "sheets"))), ["step-00000002.png", "step-00000004.png"])
        self.assertIn("PSNR", err)
        self.assertEqual(json.loads(self.read("p.json"))["peak_bytes"], result["peak_bytes"])
        line = self.log("run")[-1]
        self.assertGreater(float(line["loss"]), 0)
        self.assertGreater(int(line["intersections"]), 0)
        self.assertEqual(json.loads(self.read("run", "config.json"))["steps"], 4)
        out, _ = self.succeeds("weights", "verify", self.path("run", "model.safetensors"), "--json")
        self.assertEqual(json.loads(out)["hash"], "ok")

    def test_print_config_needs_nothing(self):
        out, _ = self.succeeds("train", "--print-config")
        defaults = json.loads(out)
        for field in ("model", "seed", "steps", "lr", "checkpoint_every"):
            self.assertIn(field, defaults)
        out, _ = self.succeeds("train", self.config(steps=9), "--print-config")
        merged = json.loads(out)
        self.assertEqual((merged["steps"], merged["model"]["image"], merged["beta2"]), (9, 16, defaults["beta2"]))
        with open(self.path("again.json"), "w") as f:
            f.write(out)
        self.assertEqual(self.succeeds("train", self.path("again.json"), "--print-config")[0], out)

    def test_the_same_bytes_each_time(self):
        config = self.config()
        self.succeeds(*self.train(config, "first"))
        self.succeeds(*self.train(config, "second"))
        self.same_training("first", "second", 6)
        other = self.config("other.json", seed=1)
        self.succeeds(*self.train(other, "third"))
        self.assertNotEqual(self.read("first", "model.safetensors"), self.read("third", "model.safetensors"))

    def tensors(self, *parts):
        """The tensors' bytes of a safetensors file."""
        data = self.read(*parts)
        return data[8 + int.from_bytes(data[:8], "little"):]

    def test_begins_with_another_models_weights(self):
        self.succeeds(*self.train(self.config(), "first"))
        weights = self.path("first", "model.safetensors")
        still = self.config("still.json", seed=9, lr=1e-30)
        self.succeeds(*self.train(still, "fine", "--init", weights))
        self.assertEqual(self.tensors("first", "model.safetensors"), self.tensors("fine", "model.safetensors"))
        self.succeeds(*self.train(still, "anew"))
        self.assertNotEqual(self.tensors("first", "model.safetensors"), self.tensors("anew", "model.safetensors"))
        deeper = self.config("deeper.json", model={"base": "micro", "sh_degree": 0})
        self.refuses(1, [weights, "sh_degree"], *self.train(deeper, "run", "--init", weights))
        self.refuses(1, [self.path("none")], *self.train(still, "run", "--init", self.path("none")))
        self.assertFalse(os.path.exists(self.path("run")))

    # ------------------------------------------------------------------------------------------------------- what ends it

    def test_killed_at_any_moment(self):
        config = self.config(steps=40, checkpoint_every=3)
        begun = time.monotonic()
        self.succeeds(*self.train(config, "whole"))
        seconds = time.monotonic() - begun
        moments = random.Random(7)
        kills = 0
        while kills < KILLS:
            process = self.start(*self.train(config, "killed", "--resume"))
            try:
                err = process.communicate(timeout=moments.uniform(0, seconds))[1]
                self.assertEqual(process.returncode, 0, err)
                shutil.rmtree(self.path("killed"))  # it came to its end: begin anew
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.communicate()
                kills += 1
        with open(self.path("killed", "log.csv.1-0.tmp"), "w") as f:  # as a kill between two moments would leave it
            f.write("step")
        self.succeeds(*self.train(config, "killed", "--resume"))
        self.same_training("whole", "killed", 40)
        self.assertFalse([name for name in os.listdir(self.path("killed")) if name.endswith(".tmp")])

    def test_interrupt_saves_and_stops(self):
        config = self.config(steps=60, checkpoint_every=0)
        self.succeeds(*self.train(config, "whole"))
        process = self.start(*self.train(config, "stopped"))
        while not os.path.exists(self.path("stopped", "log.csv")) and process.poll() is None:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        err = process.communicate(timeout=120)[1]
        self.assertEqual(process.returncode, 0, err)
        self.assertIn("--resume goes on", err)
        (name,) = [n for n in os.listdir(self.path("stopped")) if n.startswith("checkpoint-")]
        step = int(name[11:19])
        self.assertTrue(1 <= step < 60, step)
        self.assertEqual(len(self.log("stopped")), step)
        _, err = self.succeeds(*self.train(config, "stopped", "--resume"))
        self.assertIn(f"going on from step {step}", err)
        self.same_training("whole", "stopped", 60)

    def test_used_folder_and_other_configuration(self):
        self.succeeds(*self.train(self.config(), "run"))
        self.refuses(2, [self.path("run"), "--resume"], *self.train(self.config(), "run"))
        other = self.config("other.json", lr=1e-3)
        self.refuses(2, [self.path("run"), '"lr"', "0.001", "0.0004"], *self.train(other, "run", "--resume"))
        deeper = self.config("deeper.json", model={"base": "micro", "sh_degree": 0})
        self.refuses(2, [self.path("run"), '"sh_degree"'], *self.train(deeper, "run", "--resume"))
        # What no weight depends on may change.
        self.succeeds(*self.train(self.config("often.json", log_every=2, keep_checkpoints=1), "run", "--resume"))

    def test_configurations_that_are_wrong(self):
        for text, words in (("{", "JSON"), ('{"stepps": 3}', "stepps"), ('{"steps": "many"}', "steps"),
                            ('{"model": {"base": "micro", "volume_ch": -3}}', "volume_ch"), ('{"lr": -1}', "lr")):
            with open(self.path("bad.json"), "w") as f:
                f.write(text)
            code, out, err = support.run(*self.train(self.path("bad.json"), "run"))
            self.assertIn(code, (1, 2))
            self.assertEqual(out, "")
            for word in (self.path("bad.json"), words):
                self.assertIn(word, err)
        self.assertFalse(os.path.exists(self.path("run")))
        self.refuses(1, "nowhere.json", *self.train(self.path("nowhere.json"), "run"))
        self.refuses(2, "CONFIG", "train", "--data", self.solids, "--output", self.path("run"))
        self.refuses(2, "--data", "train", self.config(), "--output", self.path("run"))
        self.refuses(2, "--output", "train", self.config(), "--data", self.solids)

    def test_no_number(self):
        config = self.config(lr=1, warmup=0, weight_decay=1e30, steps=20, checkpoint_every=1, keep_checkpoints=20)
        code, _, err = support.run(*self.train(config, "run"))
        self.assertEqual(code, 1, err)
        steps = sorted(int(n[11:19]) for n in os.listdir(self.path("run")) if n.startswith("checkpoint-"))
        self.assertTrue(steps and steps[-1] < 20, steps)
        last = self.path("run", f"checkpoint-{steps[-1]:08d}.safetensors")
        for words in (f"step {steps[-1] + 1}", "loss is", "finite", last):
            self.assertIn(words, err)
        self.assertEqual(len(self.log("run")), steps[-1])
        again = support.run(*self.train(config, "run", "--resume"))  # from that checkpoint, which is good
        self.assertEqual((again[0], f"step {steps[-1] + 1}:" in again[2]), (1, True), again[2])

    # ------------------------------------------------------------------------------------------------ where it is written

    def test_folder_that_cannot_be_made(self):
        with open(self.path("file"), "w") as f:
            f.write("no folder")
        self.refuses(1, self.path("file", "run"), *self.train(self.config(), os.path.join("file", "run")))
        self.refuses(1, self.path("file"), *self.train(self.config(), "file"))

    # --------------------------------------------------------------------------------------------------------- bad data

    def test_bad_data(self):
        data = self.path("data")
        shutil.copytree(self.solids, data)
        bad = os.path.join(data, "solid_0001", "images")
        for name in os.listdir(bad):
            with open(os.path.join(bad, name), "r+b") as f:
                f.truncate(60)
        config = self.config(steps=8)
        code, _, err = support.run(*self.train(config, "run", data=data))
        self.assertEqual(code, 1, err)
        self.assertIn("solid_0001", err)
        self.assertIn(".png", err)
        out, err = self.succeeds(*self.train(config, "skipped", "--skip-bad", "--json", data=data))
        self.assertGreater(json.loads(out)["bad"], 0)
        self.assertIn("passed over", err)
        self.assertIn("solid_0001", err)
        self.refuses(1, self.path("empty"), *self.train(config, "none", data=self.path("empty")))

    # ----------------------------------------------------------------------------------------------------------- memory

    def plan(self, config, *more):
        out, _ = self.succeeds("train", config, "--dry-run", "--json", *more)
        return json.loads(out)

    def test_dry_run_tells_the_peak(self):
        config = self.config(model="tiny", steps=2, novel=3)
        for share in (0.1, 0.25, 0.9):
            with open(self.path("voxels.txt"), "w") as f:
                f.writelines(f"{v}\n" for v in range(int(share * 1000)))
            run = f"run-{share}"
            out, _ = self.succeeds(*self.train(config, run, "--selection", self.path("voxels.txt"), "--json"))
            peak = json.loads(out)["peak_bytes"]
            self.assertTrue(all(int(line["most_selected"]) == int(share * 1000) for line in self.log(run)))
            counts = ("--assume-intersections", max(int(line["intersections"]) for line in self.log(run)))
            for chosen in (("--assume-selected", share), ("--selection", self.path("voxels.txt"))):
                stated, bound = self.plan(config, *chosen, *counts)
                self.assertLess(abs(stated["peak_bytes"] - peak), 0.05 * peak, share)
                self.assertGreaterEqual(bound["peak_bytes"], peak)
                self.assertTrue(stated["fits"])

    def test_what_cannot_fit_is_not_begun(self):
        config = self.config(model="tiny", steps=2)
        stated, bound = self.plan(config, "--max-memory", 0.012)
        self.assertFalse(stated["fits"] or bound["fits"])
        err = self.refuses(1, ["0.012 GiB", "--max-memory"], *self.train(config, "run", "--max-memory", 0.012))
        self.assertIn(f"{stated['peak_bytes'] / 2**30:.3f} GiB", err)

    def test_sheet_that_does_not_fit_is_left_out(self):
        # Many Gaussians of the one voxel that steps refine: a sheet refines the half that an untrained network selects.
        config = self.config(model={"base": "tiny", "fine_count": 256}, steps=2, sheet_every=1)
        with open(self.path("voxels.txt"), "w") as f:
            f.write("500\n")
        _, err = self.succeeds(*self.train(config, "run", "--selection", self.path("voxels.txt"), "--max-memory", 0.03))
        for step in (1, 2):
            self.assertIn(self.path("run", "sheets", f"step-{step:08d}.png") + " is left out: not enough device memory", err)
        self.assertEqual(os.listdir(self.path("run", "sheets")), [])
        self.assertTrue(os.path.exists(self.path("run", "model.safetensors")))

    def test_little_memory_gives_the_same_bits(self):
        config = self.config(model="tiny", steps=3)
        with open(self.path("voxels.txt"), "w") as f:
            f.writelines(f"{v}\n" for v in range(100))
        choice = ("--selection", self.path("voxels.txt"), "--json")
        out, _ = self.succeeds(*self.train(config, "much", *choice))
        peak = json.loads(out)["peak_bytes"]
        out, _ = self.succeeds(*self.train(config, "little", *choice, "--max-memory", 0.97 * peak / 2**30))
        self.assertLessEqual(json.loads(out)["peak_bytes"], 0.97 * peak)
        self.assertEqual(self.read("much", "model.safetensors"), self.read("little", "model.safetensors"))


if __name__ == "__main__":
    support.main()
