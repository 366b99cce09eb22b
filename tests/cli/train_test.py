"""vsplat train as a user runs it: what it writes, what ends it, and that it continues as if nothing had happened."""
import array
import json
import os
import pathlib
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
                         ["checkpoint-00000004.safetensors", "config.json", "log.csv", "model.safetensors", "record.json", "report.html", "sheets"])
        self.assertEqual(sorted(os.listdir(self.path("run", "sheets"))), ["step-00000002.png", "step-00000004.png"])
        self.assertIn("PSNR", err)
        self.assertEqual(json.loads(self.read("p.json"))["peak_bytes"], result["peak_bytes"])
        line = self.log("run")[-1]
        self.assertGreater(float(line["loss"]), 0)
        self.assertGreater(int(line["intersections"]), 0)
        self.assertEqual(json.loads(self.read("run", "config.json"))["steps"], 4)
        out, _ = self.succeeds("weights", "verify", self.path("run", "model.safetensors"), "--json")
        self.assertEqual(json.loads(out)["hash"], "ok")

    def test_noise_on_poses(self):
        """The option sets the configuration's field; it changes the log, and two runs give the same log."""
        noise = ("--pose-noise", 0.03)
        self.assertEqual(json.loads(self.succeeds("train", "--print-config", *noise)[0])["pose_noise"], 0.03)
        stages = self.path("stages.json")
        json.dump({"model": "micro", "stages": [{"steps": 5}, {"steps": 6, "pose_noise": 0.5}]}, open(stages, "w"))
        report = json.loads(self.succeeds("train", stages, "--print-config", *noise)[0])
        self.assertEqual([stage["pose_noise"] for stage in report["stages"]], [0.03, 0.03])
        self.refuses(2, "--pose-noise", "train", stages, "--print-config", "--pose-noise", 2)
        config, losses = self.config(steps=2, log_every=1), []
        for run, more in (("plain", ()), ("noisy", noise), ("again", noise)):
            self.succeeds(*self.train(config, run, *more))
            losses.append([line["loss"] for line in self.log(run)])
        self.assertEqual(losses[1], losses[2])
        self.assertNotEqual(losses[0], losses[1])

    def test_print_config_needs_nothing(self):
        out, _ = self.succeeds("train", "--print-config")
        defaults = json.loads(out)
        for field in ("model", "seed", "steps", "lr", "checkpoint_every"):
            self.assertIn(field, defaults)
        out, _ = self.succeeds("train", self.config(steps=9), "--print-config")
        merged = json.loads(out)
        self.assertEqual((merged["steps"], merged["model"]["image"], merged["beta2"]), (9, 16, defaults["beta2"]))
        pathlib.Path(self.path("again.json")).write_text(out)
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
        """Returns the tensors' bytes of a safetensors file."""
        data = self.read(*parts)
        return data[8 + int.from_bytes(data[:8], "little"):]

    def values(self, *parts):
        """Returns the values of each tensor of a safetensors file of floats, by name."""
        data = self.read(*parts)
        size = 8 + int.from_bytes(data[:8], "little")
        header = json.loads(data[8:size])
        header.pop("__metadata__", None)
        return {name: list(array.array("f", data[slice(*(size + at for at in entry["data_offsets"]))])) for name, entry in header.items()}

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

    @support.slow
    def test_extended(self):
        """Two commands give the same bits each time, interrupted or not, and the same as one command with both lengths. In the quick tests: stages,
        which end and begin in the same way, and a training that is killed."""
        config = self.config()
        extend = ("--resume", "--extend", 5)
        for run in ("first", "second"):
            self.succeeds(*self.train(config, run))
            before = self.tensors(run, "model.safetensors")
            out, err = self.succeeds(*self.train(config, run, *extend))
            self.assertIn("step 11 of 11", err)
            self.assertNotEqual(self.tensors(run, "model.safetensors"), before)
        self.same_training("first", "second", 11)
        rates = [float(line["lr"]) for line in self.log("first")]
        self.assertEqual(len(rates), 11)
        self.assertTrue(rates[5] < 1e-12 and rates[6] == max(rates) and rates[10] < 1e-12, rates)
        # Killed on the way and continued by the same command; run once more, it finds everything done.
        self.succeeds(*self.train(config, "killed"))
        process = self.start(*self.train(config, "killed", *extend))
        while not os.path.exists(self.path("killed", "checkpoint-00000008.safetensors")) and process.poll() is None:
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        self.succeeds(*self.train(config, "killed", *extend))
        self.same_training("first", "killed", 11)
        _, err = self.succeeds(*self.train(config, "killed", *extend))
        self.assertIn("all 11 steps are done; --extend", err)
        self.same_training("first", "killed", 11)
        # Without the option it continues as extended before; extended again, it gets another cosine.
        self.succeeds(*self.train(config, "killed", "--resume"))
        self.same_training("first", "killed", 11)
        self.succeeds(*self.train(config, "killed", "--resume", "--extend", "5,4"))
        self.assertEqual(int(self.log("killed")[-1]["step"]), 15)
        self.refuses(2, ['found "extend": [5]', 'expected "extend": [6]'], *self.train(config, "first", "--resume", "--extend", 6))
        self.refuses(2, ["--extend", "--resume"], *self.train(config, "new", "--extend", 5))
        self.refuses(2, ["--extend", "no checkpoint"], *self.train(config, "new", *extend))
        self.refuses(2, "--extend", *self.train(config, "first", "--resume", "--extend", 0))

    def test_goes_on_with_other_sizes(self):
        """A model's weights can be used for other pictures and volumes; values in units of the cube's edge are scaled."""
        self.succeeds(*self.train(self.config(), "small"))
        weights = self.path("small", "model.safetensors")
        larger = self.config("larger.json", lr=1e-30, steps=1, warmup=0, model={"base": "micro", "image": 32, "volume": 8, "views": 3})
        _, err = self.succeeds(*self.train(larger, "larger", "--init", weights))
        self.assertIn("made for pictures of 16 pixels and 4 voxels an edge, continues with 32 and 8; 6 places within a voxel scaled by 0.5", err)
        old, new = (self.values(run, "model.safetensors") for run in ("small", "larger"))
        self.assertEqual(list(old), list(new))
        for name in old:
            self.assertEqual(new[name], [v * 0.5 for v in old[name]] if name == "div_offset" else old[name], name)
        self.succeeds("weights", "convert", weights, "--dtype", "f32", "--view-count", 3, "--output", self.path("counted.safetensors"))
        self.succeeds(*self.train(larger, "counted", "--init", self.path("counted.safetensors")))  # no weight depends on the number of views that it picks
        wider = self.config("wider.json", model={"base": "micro", "volume": 8, "volume_ch": 8})
        self.refuses(1, ['found "volume_ch": 4, expected "volume_ch": 8'], *self.train(wider, "run", "--init", weights))

    def test_stages(self):
        """One configuration with growing sizes: killed in either stage and resumed, the same bytes; also if done by hand with --init."""
        fields = dict(steps=6, stages=[{"steps": 5}, {"lr": 2e-4, "model": {"image": 32, "volume": 8}}])
        config = self.config(**fields)
        _, err = self.succeeds(*self.train(config, "whole"))
        for words in ("stage 1 of 2", "step 5 of 5", "stage 2 of 2", "continues with 32 and 8", "step 6 of 6"):
            self.assertIn(words, err)
        self.assertEqual(sorted(os.listdir(self.path("whole"))), ["config.json", "model.safetensors", "report.html", "stage-1", "stage-2"])
        self.assertEqual(self.read("whole", "model.safetensors"), self.read("whole", "stage-2", "model.safetensors"))
        self.assertEqual(len(json.loads(self.read("whole", "config.json"))["stages"]), 2)
        for at in (os.path.join("stage-1", "checkpoint-00000002.safetensors"), os.path.join("stage-2", "checkpoint-00000002.safetensors")):
            process = self.start(*self.train(config, "killed", "--resume"))
            while not os.path.exists(self.path("killed", at)) and process.poll() is None:
                time.sleep(0.002)
            process.send_signal(signal.SIGKILL)
            process.communicate()
        _, err = self.succeeds(*self.train(config, "killed", "--resume"))
        self.assertIn("stage 1 of 2 is done", err)
        for stage, step in (("stage-1", 5), ("stage-2", 6)):
            self.same_training(os.path.join("whole", stage), os.path.join("killed", stage), step)
        self.assertEqual(self.read("whole", "model.safetensors"), self.read("killed", "model.safetensors"))
        self.refuses(2, ["stage-1", "--resume"], *self.train(config, "whole"))
        # By hand: the seed increases by one for each stage.
        self.succeeds(*self.train(self.config("one.json", steps=5), "one"))
        self.assertEqual(self.read("one", "model.safetensors"), self.read("whole", "stage-1", "model.safetensors"))
        second = self.config("two.json", seed=1, lr=2e-4, model={"base": "micro", "image": 32, "volume": 8})
        self.succeeds(*self.train(second, "two", "--init", self.path("one", "model.safetensors")))
        self.assertEqual(self.read("two", "model.safetensors"), self.read("whole", "model.safetensors"))
        # An extension applies to the last stage.
        self.succeeds(*self.train(config, "whole", "--resume", "--extend", 3))
        self.assertEqual(int(self.log(os.path.join("whole", "stage-2"))[-1]["step"]), 9)
        wrong = self.config("wrong.json", stages=[{}, {"model": {"sh_degree": 0}}])
        self.refuses(1, ["stage 2", "stage 1", 'found "sh_degree": 1, expected "sh_degree": 0'], *self.train(wrong, "wrong"))
        self.succeeds("train", config, "--dry-run")

    @support.slow
    def test_procedural_objects_while_training(self):
        """A share of the objects is drawn during training. Interrupted and resumed, the bytes are the same; a share of 0 draws none; a share of 1
        needs no data. In the quick tests: such a share in Ranks.test_training_is_the_same_on_any_number."""
        os.makedirs(self.path("pictures"))
        support.write_png(self.path("pictures", "paint.png"), 2, 1, [[(250, 0, 0), (0, 0, 250)]])
        textures = ("--textures", self.path("pictures"))
        config = self.config(steps=16, checkpoint_every=3, procedural=0.5, accumulate=2)
        self.succeeds(*self.train(config, "whole", *textures))
        process = self.start(*self.train(config, "killed", *textures))
        while process.poll() is None and not os.path.exists(self.path("killed", "checkpoint-00000006.safetensors")):
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        self.succeeds(*self.train(config, "killed", *textures, "--resume"))
        self.same_training("whole", "killed", 16)
        self.succeeds(*self.train(config, "bare"))
        roomy = self.config("roomy.json", rooms=1, accumulate=2)
        self.succeeds(*self.train(roomy, "roomy", *textures))
        self.succeeds(*self.train(roomy, "painted"))
        self.assertNotEqual(self.read("painted", "model.safetensors"), self.read("roomy", "model.safetensors"), "on walls, too")
        self.assertNotEqual(self.read("bare", "model.safetensors"), self.read("whole", "model.safetensors"), "the textures are seen")
        self.succeeds(*self.train(self.config("before.json"), "before"))
        self.succeeds(*self.train(self.config("none.json", procedural=0), "none"))
        self.same_training("before", "none", 6)
        all_drawn = self.config("all.json", procedural=1)
        self.succeeds("train", all_drawn, "--output", self.path("all"))
        self.refuses(2, ["--data", "procedural"], "train", config, "--output", self.path("new"))
        self.refuses(2, ["--textures", "procedural"], *self.train(self.config("none.json", procedural=0), "new", *textures))
        self.refuses(1, "nowhere", "train", all_drawn, "--output", self.path("new"), "--textures", self.path("nowhere"))

    def test_schedules_that_do_not_end_are_reported(self):
        _, err = self.succeeds(*self.train(self.config(steps=2, warmup=2, tau_steps=50000), "run"))
        self.assertIn("warning: the learning rate rises for 2 of 2 steps", err)
        self.assertIn('warning: the temperature ends at 1.00 and not at "tau_last"', err)
        _, err = self.succeeds(*self.train(self.config(steps=2, warmup=0), "usual"))
        self.assertNotIn("warning", err)

    # ------------------------------------------------------------------------------------------------------- what ends it

    def test_killed_at_any_moment(self):
        config = self.config(steps=40, checkpoint_every=3)
        begun = time.monotonic()
        self.succeeds(*self.train(config, "whole"))
        seconds = time.monotonic() - begun
        moments = random.Random(7)
        kills = 0
        while kills < KILLS or not os.path.exists(self.path("killed")):  # a kill may come before it is made
            process = self.start(*self.train(config, "killed", "--resume"))
            try:
                err = process.communicate(timeout=moments.uniform(0, seconds))[1]
                self.assertEqual(process.returncode, 0, err)
                shutil.rmtree(self.path("killed"))  # it had finished: start again
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.communicate()
                kills += 1
        for name in ("log.csv", "record.json", "report.html"):  # as if it had been killed between two files
            pathlib.Path(self.path("killed", name + ".1-0.tmp")).write_text("step")
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
        self.assertEqual(process.returncode, 130, err)
        self.assertIn("--resume continues", err)
        (name,) = [n for n in os.listdir(self.path("stopped")) if n.startswith("checkpoint-")]
        step = int(name[11:19])
        self.assertTrue(1 <= step < 60, step)
        self.assertEqual(len(self.log("stopped")), step)
        _, err = self.succeeds(*self.train(config, "stopped", "--resume"))
        self.assertIn(f"going on from step {step}", err)
        self.same_training("whole", "stopped", 60)

    def test_first_steps_are_reported_and_how_long_it_takes(self):
        config = self.config(steps=1000000000, log_every=1000000, checkpoint_every=0)
        process = self.start(*self.train(config, "long"))
        lines = []
        for line in process.stderr:
            lines.append(line)
            if line.startswith("warning") or "first steps: 8 " in line:
                break
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
        text = "".join(lines)
        self.assertIn("first steps: 1 of 1000000000, loss ", text)
        self.assertRegex(text, r"warning: the 999999998 steps that are left take about \d+ days on this device")
        _, err = self.succeeds(*self.train(self.config(steps=3), "short"))
        self.assertNotIn("on this device", err)

    def test_used_folder_and_other_configuration(self):
        self.succeeds(*self.train(self.config(), "run"))
        self.refuses(2, [self.path("run"), "--resume"], *self.train(self.config(), "run"))
        other = self.config("other.json", lr=1e-3)
        self.refuses(2, [self.path("run"), 'found "lr": 0.0004, expected "lr": 0.001', "config.json"], *self.train(other, "run", "--resume"))
        deeper = self.config("deeper.json", model={"base": "micro", "sh_degree": 0})
        self.refuses(2, [self.path("run"), '"sh_degree"'], *self.train(deeper, "run", "--resume"))
        # Fields that no weight depends on may change.
        self.succeeds(*self.train(self.config("often.json", log_every=2, keep_checkpoints=1), "run", "--resume"))

    def test_configurations_that_are_wrong(self):
        for text, words in (("{", "JSON"), ('{"stepps": 3}', "stepps"), ('{"steps": "many"}', "steps"),
                            ('{"model": {"base": "micro", "volume_ch": -3}}', "volume_ch"), ('{"lr": -1}', "lr")):
            pathlib.Path(self.path("bad.json")).write_text(text)
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
        again = support.run(*self.train(config, "run", "--resume"))  # from that checkpoint, which is valid
        self.assertEqual((again[0], f"step {steps[-1] + 1}:" in again[2]), (1, True), again[2])

    # ------------------------------------------------------------------------------------------------ where it is written

    def test_folder_that_cannot_be_made(self):
        pathlib.Path(self.path("file")).write_text("no folder")
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
        self.assertIn("it is skipped", err)
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

    def test_a_model_beyond_all_memory_is_planned_and_refused(self):
        """Planned without making the weights, which would take 100 GB."""
        config = self.config(model={"base": "paper", "vit_dim": 16384, "vit_heads": 16, "vit_depth": 8})
        stated, bound = self.plan(config)
        self.assertGreater(stated["peak_bytes"], 300 << 30)
        self.assertFalse(stated["fits"] or bound["fits"])
        self.refuses(1, ["not enough device memory", "--max-memory"], *self.train(config, "run"))

    def test_a_configuration_is_no_more_than_a_file_of_text(self):
        with open(self.path("large.json"), "wb") as f:
            f.truncate((64 << 20) + 1)
        self.refuses(1, ["large.json", "64 MiB"], "train", self.path("large.json"), "--print-config")

    def test_sheet_that_does_not_fit_is_left_out(self):
        # Many Gaussians in the only voxel that steps refine: a sheet refines the half that an untrained network selects.
        config = self.config(model={"base": "tiny", "fine_count": 256}, steps=2, sheet_every=1)
        pathlib.Path(self.path("voxels.txt")).write_text("500\n")
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
