"""Hazards of a shell: two commands at once, signals, limits, outputs that are also inputs. Nothing is lost, and no file that the command did
not create is touched."""
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import time

import support
import train_support


class Outputs(train_support.Case):
    def put(self, *parts, text="mine"):
        os.makedirs(os.path.dirname(self.path(*parts)), exist_ok=True)
        pathlib.Path(self.path(*parts)).write_text(text)
        return self.path(*parts)

    def test_a_training_replaces_nothing_unasked(self):
        config = self.config("config.json")
        self.succeeds("init", "micro", "--seed", 3, "--output", self.path("model.safetensors"))
        self.refuses(2, ["config.json", "cannot be the output"], *self.train(config, "", "--init", self.path("model.safetensors")))
        self.refuses(2, ["config.json", "cannot be the output"], *self.train(config, "", "--overwrite"))
        other = self.config("other.json")
        self.refuses(2, ["model.safetensors", "cannot be the output"],
                     *self.train(other, "", "--init", self.path("model.safetensors"), "--overwrite"))
        for name in ("config.json", "log.csv", "model.safetensors", "record.json", "report.html", os.path.join("sheets", "step-00000002.png")):
            self.put("run", name)
            for more in ((), ("--resume",)):
                self.refuses(1, [name, "--overwrite"], *self.train(other, "run", *more))
            os.remove(self.path("run", name))
        self.put("run", "log.csv")
        self.succeeds(*self.train(other, "run", "--overwrite"))
        self.assertEqual(len(self.log("run")), 6)
        # What a run has left belongs to it, including its configuration; other files in its folder stay.
        self.put("run", "notes.txt")
        self.succeeds(*self.train(self.path("run", "config.json"), "run", "--resume"))
        self.assertEqual(self.read("run", "notes.txt"), b"mine")

    def test_a_stage_replaces_nothing_unasked(self):
        config = self.config(stages=[{"steps": 2}, {"steps": 2}])
        self.put("run", "stage-2", "log.csv")
        self.refuses(1, [os.path.join("stage-2", "log.csv"), "--overwrite"], *self.train(config, "run"))

    def test_what_is_read_is_never_written(self):
        shutil.copytree(self.solids, self.path("set"))
        picture = self.path("set", "solid_0000", "images", "0000.png")
        cameras = self.path("set", "solid_0000", "transforms.json")
        for command in (("dataset", "info", self.path("set"), "--sheet", picture), ("evaluate", self.path("set"), "--sheet", picture),
                        ("evaluate", self.path("set"), "--profile", cameras), self.train(self.config(), "run", "--trace", picture, data=self.path("set"))):
            self.refuses(2, "cannot be the output", *command, "--overwrite")
        support.write_scene(self.path("s.ply"), [((0, 0, 0), (1, 0, 0), 0.1, 0.9)])
        self.refuses(2, "cannot be the output", "render", self.path("s.ply"), "--cameras", self.path("set", "solid_0000"), "--write-cameras", cameras,
                     "--overwrite")

    def test_links_are_replaced_and_not_followed(self):
        target = self.put("target")
        os.symlink(target, self.path("p.json"))
        self.succeeds(*self.train(self.config(), "run", "--profile", self.path("p.json"), "--overwrite"))
        self.assertEqual(self.read("target"), b"mine")
        self.assertFalse(os.path.islink(self.path("p.json")))

    def scene(self):
        support.write_scene(self.path("s.ply"), [((0, 0, 0), (1, 0, 0), 0.1, 0.9)])
        return ("render", self.path("s.ply"), "--up", "0,1,0", "--size", "8x8", "--quiet")

    def test_what_cannot_be_written_is_refused_before_the_work(self):
        """Dangling links, names that are too long, one folder under two names, and a file in place of a folder."""
        render = (*self.scene(), "--cameras", "orbit:2")
        os.symlink("gone.png", self.path("dead.png"))
        os.symlink("nowhere", self.path("dead"))
        os.symlink("loop", self.path("loop"))
        self.put("real", "kept")
        os.symlink("real", self.path("other"))
        out = lambda option, *parts: (option, self.path(*parts))
        self.refuses(1, ["dead.png is a link to gone.png, which is not there"], *render, *out("--sheet", "dead.png"))
        self.refuses(1, ["dead is a link to nowhere, which is not there"], *render, *out("--images", "dead"))
        self.refuses(1, ["dead is a link to nowhere, which is not there"], *render, *out("--sheet", "dead", "below", "s.png"))
        self.refuses(1, ["loop"], *render, *out("--images", "loop"))
        self.refuses(1, ["has 256 bytes, which is more than a name"], *render, *out("--sheet", "x" * 252 + ".png"))
        self.refuses(1, ["has 300 bytes, which is more than a name"], *render, *out("--images", "x" * 300))
        self.refuses(1, ["bytes, which is more than a path"], *render, "--sheet", os.path.join(self.folder, *["y" * 200] * 25, "s.png"))
        self.refuses(2, ["written twice", os.path.join("real", "0000.png")], *render, *out("--images", "real"), *out("--sheet", "other", "0000.png"))
        self.refuses(2, ["written twice"], *render, *out("--images", "real"), "--sheet", os.path.join(self.folder, "other", "..", "real", "0000.png"))
        self.refuses(2, ["a file and the folder of"], *render, *out("--sheet", "s.png"), *out("--images", "s.png"))
        self.refuses(2, ["a file and the folder of"], *render, *out("--images", "t.png", "in"), *out("--sheet", "t.png"))
        # The longest names that a folder allows are valid; a dangling link is replaced on request.
        for length in (240, 246, 250, 255):
            name = "x" * (length - 4) + ".png"
            self.succeeds(*render, *out("--sheet", name))
            self.assertTrue(os.path.isfile(self.path(name)))
        wide = "\u00e4" * 125 + ".png"
        self.succeeds(*render, *out("--sheet", wide))
        self.assertTrue(os.path.isfile(self.path(wide)))
        self.succeeds(*render, *out("--sheet", "dead.png"), "--overwrite")
        self.assertTrue(os.path.isfile(self.path("dead.png")) and not os.path.islink(self.path("dead.png")))
        self.assertFalse(os.path.exists(self.path("gone.png")))
        self.assertFalse([name for name in os.listdir(self.folder) if name.endswith(".tmp")])

    def test_a_folder_that_vanishes_meanwhile(self):
        process = subprocess.Popen([support.VSPLAT, *map(str, self.scene()), "--cameras", "orbit:400", "--images", self.path("out"), "--kernels", "cpu"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        while not os.path.exists(self.path("out", "0003.png")):
            self.assertIsNone(process.poll(), process.stderr.read() if process.poll() is not None else "")
            time.sleep(0.001)
        os.rename(self.path("out"), self.path("moved"))
        _, err = process.communicate(timeout=support.PATIENCE)
        self.assertEqual(process.returncode, 1, err)
        self.assertIn(self.path("out"), err)
        self.assertFalse(os.path.exists(self.path("out")), "an output that was begun is removed")

    def test_printing_that_fails_is_an_error(self):
        for command in (["--version"], ["devices", "--json"], ["train", "--print-config"], ["help", "render"]):
            with open("/dev/full", "w") as full:
                done = subprocess.run([support.VSPLAT, *command], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
            self.assertEqual(done.returncode, 1, command)
            self.assertIn("stdout", done.stderr)


class Sets(support.FolderCase):
    """Several `dataset` commands write into one folder."""
    def solids(self, *more, views=8, size=16, count=1, to="set"):
        return ("dataset", "procedural", "--solids", "--count", count, "--views", views, "--size", size, "--output", self.path(to), *more)

    def start(self, *arguments, **options):
        return subprocess.Popen([support.VSPLAT, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **options)

    def wait_for(self, path, process):
        while not os.path.exists(path):
            self.assertIsNone(process.poll(), process.stderr.read() if process.poll() is not None else "")
            time.sleep(0.001)

    def files(self, *parts):
        top = self.path(*parts)
        return {name[len(top):]: data for name, data in self.snapshot().items() if name.startswith(top + "/")}

    def begun(self, *more, **options):
        """A process that is drawing its second picture."""
        process = self.start(*self.solids(*more, views=400, size=64), **options)
        self.wait_for(self.path("set", ".solid_0000.unfinished", "images", "0001.png"), process)
        return process

    def test_two_at_once(self):
        first = self.begun()
        self.assertEqual(sorted(os.listdir(self.path("set"))), [".solid_0000.unfinished"])
        code, _, err = support.run(*self.solids())
        self.assertEqual(code, 1, err)
        self.assertIn("solid_0000: another process is writing", err)
        self.succeeds("dataset", "procedural", "--solids", "--count", 1, "--views", 2, "--size", 16, "--output", self.path("other"))
        _, err = first.communicate(timeout=200)
        self.assertEqual(first.returncode, 0, err)
        self.assertEqual(len(os.listdir(self.path("set", "solid_0000", "images"))), 400)
        self.assertEqual(os.listdir(self.path("set")), ["solid_0000"])

    def test_interrupted_it_removes_what_it_made(self):
        for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)):
            process = self.begun()
            os.makedirs(self.path("set", "solid_0000"))
            pathlib.Path(self.path("set", "solid_0000", "transforms.json")).write_text("another's")
            process.send_signal(number)
            _, err = process.communicate(timeout=60)
            self.assertEqual(process.returncode, code, err)
            self.assertEqual(self.files("set", "solid_0000"), {"/transforms.json": b"another's"})
            self.assertEqual(os.listdir(self.path("set")), ["solid_0000"])
            shutil.rmtree(self.path("set"))

    def test_made_meanwhile_by_another(self):
        process = self.start(*self.solids(views=60, size=64))
        self.wait_for(self.path("set", ".solid_0000.unfinished", "images", "0001.png"), process)
        os.makedirs(self.path("set", "solid_0000"))
        pathlib.Path(self.path("set", "solid_0000", "transforms.json")).write_text("another's")
        _, err = process.communicate(timeout=100)
        self.assertEqual(process.returncode, 1, err)
        self.assertIn("transforms.json: exists, and is kept", err)
        self.assertEqual(self.files("set"), {"/solid_0000": None, "/solid_0000/transforms.json": b"another's"})

    def test_an_ignored_hangup_stays_ignored(self):
        process = self.start(*self.solids(views=60, size=64), preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        self.wait_for(self.path("set", ".solid_0000.unfinished", "images", "0001.png"), process)
        process.send_signal(signal.SIGHUP)
        _, err = process.communicate(timeout=100)
        self.assertEqual(process.returncode, 0, err)

    def test_a_limit_on_files(self):
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))
        process = self.start(*self.solids(), preexec_fn=limit)
        _, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 1, err)
        self.assertIn("File too large", err)
        self.assertEqual(os.listdir(self.folder), [])

    def test_what_a_killed_one_left_is_taken_over(self):
        process = self.begun()
        process.kill()
        process.communicate()
        self.assertEqual(os.listdir(self.path("set")), [".solid_0000.unfinished"])
        self.succeeds(*self.solids())
        self.succeeds(*self.solids(to="anew"))
        self.assertEqual(self.files("set"), self.files("anew"))

    def test_replaced_whole_or_not_at_all(self):
        self.succeeds(*self.solids("--seed", 1, views=12))
        self.succeeds(*self.solids("--seed", 2, views=9, to="new"))
        before, after = self.files("set", "solid_0000"), self.files("new", "solid_0000")
        for parts in (("notes.txt",), ("images", "mine.png"), ("masks", "0000.png")):
            os.makedirs(os.path.dirname(self.path("set", "solid_0000", *parts)), exist_ok=True)
            pathlib.Path(self.path("set", "solid_0000", *parts)).write_text("mine")
        whole = self.files("set", "solid_0000")
        mine = {name: data for name, data in whole.items() if name not in before}
        self.assertEqual(len(mine), 4)
        states = {json.dumps(sorted(map(repr, s.items()))): name for s, name in ((whole, "before"), ({**after, **mine}, "after"))}
        shutil.copytree(self.path("set"), self.path("kept"))
        command = self.solids("--seed", 2, "--overwrite", views=9)
        begun = time.monotonic()
        self.succeeds(*command)
        seconds = time.monotonic() - begun
        moments, seen = random.Random(5), set()
        for i in range(20):
            shutil.rmtree(self.path("set"))
            shutil.copytree(self.path("kept"), self.path("set"))
            process = self.start(*command)
            time.sleep(moments.uniform(0, seconds))
            process.send_signal(signal.SIGKILL if i % 2 else signal.SIGINT)
            process.communicate(timeout=60)
            state = json.dumps(sorted(map(repr, self.files("set", "solid_0000").items())))
            self.assertIn(state, states, f"moment {i}")
            seen.add(states[state])
        self.assertIn("before", seen)
        self.succeeds(*command)
        self.assertEqual(self.files("set", "solid_0000"), {**after, **mine})
        self.assertEqual(os.listdir(self.path("set")), ["solid_0000"])


class Trainings(train_support.Case):
    def test_two_at_once(self):
        config = self.config(steps=2000, checkpoint_every=0)
        first = self.start(*self.train(config, "run"))
        while not os.path.exists(self.path("run", "log.csv")):
            self.assertIsNone(first.poll())
            time.sleep(0.005)
        for more in (("--resume",), ("--overwrite",)):
            code, _, err = support.run(*self.train(config, "run", *more))
            self.assertEqual(code, 1, err)
            self.assertIn("run: another process is writing", err)
        first.send_signal(signal.SIGHUP)
        _, err = first.communicate(timeout=60)
        self.assertEqual(first.returncode, 129, err)
        self.assertIn("--resume continues", err)
        self.assertTrue([name for name in os.listdir(self.path("run")) if name.startswith("checkpoint-")])


if __name__ == "__main__":
    support.main()
