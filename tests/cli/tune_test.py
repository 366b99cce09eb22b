"""vsplat tune: its choices are used and correct, it survives being killed, and it rejects wrong sets."""
import glob
import hashlib
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time

import support
import train_support

CL = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "cl")


def tables(cache):
    """Returns the paths of devices' tables, without those that are stored under their hash."""
    return sorted(p for p in glob.glob(os.path.join(cache, "tuning", "*.json")) if not os.path.basename(p).startswith("table-"))


def chosen_text(flavour, entry):
    words = lambda named: " ".join(f"{name}={value}" for name, value in named.items())
    return f"{flavour} {entry['op']} {words(entry['shape'])}: {words(entry['set'])}\n"


def with_choice(table, entry):
    """Returns the table with only that choice."""
    out = {**table, "chosen": [entry], "tried": []}
    out["hash"] = hashlib.sha256(chosen_text(table["flavour"], entry).encode()).hexdigest()
    return out


def sets_of(trials):
    """Returns what was tried; the outcome may change when a better set is found."""
    return [json.dumps([t["op"], t["shape"], t["set"]]) for t in trials]


class Tuned:
    """Uses a separate cache for tables, and the user's for the driver."""

    def tune_environment(self, **more):
        return {"VSPLAT_CACHE_DIR": self.path("cache"), "VSPLAT_TUNING": "", **more}

    def tune(self, *more, env=None, code=0):
        got, out, err = support.run("tune", "--json", *more, env=env or self.tune_environment())
        self.assertEqual(got, code, err)
        return json.loads(out), err

    def table(self):
        found = tables(self.path("cache"))
        self.assertEqual(len(found), 1, found)
        with open(found[0]) as f:
            return found[0], json.load(f)

    def write(self, name, table):
        pathlib.Path(self.path(name)).write_text(json.dumps(table))
        return self.path(name)


class Searching(Tuned, support.Case):
    def begun(self):
        """Runs until some sets were tried, however many a machine tries in a second. Returns the last progress message."""
        result = {"tried": 0}
        for _ in range(60):
            before = len(self.table()[1]["tried"]) if tables(self.path("cache")) else 0
            result, err = self.tune("--model", self.model, "--for", "reconstruct", "--seconds", 1)
            path, table = self.table()
            self.assertEqual((result["path"], result["table"]), (path, table["hash"]))
            self.assertEqual(result["refused"], [], err)
            self.assertEqual(result["not_right"], [])
            self.assertGreater(result["tried"], 0)
            self.assertEqual(len(table["tried"]), before + result["tried"])
            if len(table["tried"]) > 5:
                break
        self.assertGreater(len(table["tried"]), 5)
        self.assertEqual({t["verdict"] for t in table["tried"]} - {"default", "best", "slower"}, set())
        self.assertLessEqual(max(t["error"] for t in table["tried"]), 1e-4)
        self.assertGreater(max(t["error"] for t in table["tried"]), 0, "nothing was held against anything")
        for one in result["chosen"]:
            self.assertGreaterEqual(one["times_as_fast"], 1 / 0.97 - 1e-9, one)

    def to_the_end(self, *job):
        """Sets that were tried are not tried again; a completed search leaves nothing to do."""
        _, table = self.table()
        again, _ = self.tune(*job, "--seconds", 200)
        _, now = self.table()
        self.assertEqual(again["left"], 0)
        self.assertGreater(again["tried"], 0)
        self.assertEqual(len(now["tried"]), len(table["tried"]) + again["tried"])
        self.assertEqual(sets_of(now["tried"])[:len(table["tried"])], sets_of(table["tried"]))
        sets = sets_of(now["tried"])
        self.assertEqual(len(sets), len(set(sets)))
        # From the best set so far, one parameter at a time, until nothing is new.
        done = again
        for _ in range(8):
            if done["tried"] == 0:
                break
            done, _ = self.tune(*job, "--seconds", 200)
        self.assertEqual((done["tried"], done["left"]), (0, 0))
        _, now = self.table()
        self.assertEqual((done["table"], done["before"]), (now["hash"], now["hash"]))
        if now["hash"]:
            with open(self.path("cache", "tuning", f"table-{now['hash']}.json")) as f:
                self.assertEqual(json.load(f)["chosen"], now["chosen"])


class Tune(Searching):
    def test_what_it_finds_is_used_and_kept(self):
        """Searches completely for drawing, which has few shapes."""
        self.begun()
        self.to_the_end("--model", self.model, "--for", "render")

    @support.slow
    def test_a_network_to_the_end(self):
        self.begun()
        self.to_the_end("--model", self.model, "--for", "reconstruct")

    def test_a_table_is_reported_and_gives_the_same_bytes(self):
        for flavour in ("cpu", "gpu"):
            result, _ = self.tune("--model", self.model, "--for", "reconstruct", "--seconds", 1e-9, "--kernels", flavour,
                                "--output", self.path(f"{flavour}.json"))
            self.assertGreater(result["left"], 0)
            with open(self.path(f"{flavour}.json")) as f:
                empty = json.load(f)  # the file exists even if nothing was tried in so short a time
            self.assertEqual((empty["chosen"], empty["tried"]), ([], []))
            # Tiles and attention with other sizes than the defaults, at the model's shapes.
            entries = {"cpu": {"op": "attention_forward", "set": {"rows": 4, "panels": 1}},
                       "gpu": {"op": "gemm", "set": {"tile": 128, "unroll": 8, "split": 1}}}[flavour]
            shape = next(t["shape"] for t in result["shapes"] if t["op"] == entries["op"])
            table = with_choice(empty, {"op": entries["op"], "shape": shape, "set": entries["set"]})
            env = self.tune_environment(VSPLAT_TUNING=self.write(f"{flavour}-table.json", table))
            results = []
            for i in range(3):
                out, err = self.succeeds(*self.reconstruct("--kernels", flavour, "--json", "--overwrite"), env=env)
                self.assertIn(f"tuned (table {table['hash'][:12]})", err.splitlines()[0])
                self.assertEqual(json.loads(out)["tuning"], table["hash"])
                self.assertEqual(json.loads(out)["precision"], "fp32")
                results.append(pathlib.Path(self.path("out.ply")).read_bytes())
            self.assertEqual(results[0], results[1])
            self.assertEqual(results[0], results[2])
            out, err = self.succeeds(*self.reconstruct("--kernels", flavour, "--json", "--overwrite"), env=self.tune_environment(VSPLAT_TUNING="off"))
            self.assertNotIn("tuned", err.splitlines()[0])
            self.assertIsNone(json.loads(out)["tuning"])
            out, _ = self.succeeds("kernels", "--model", self.model, "--no-build", "--flavour", flavour, "--for", "reconstruct", "--json", env={**env})
            options = {p["options"] for p in json.loads(out) if any(a["launches"] for a in p["about"])}
            wanted = {"cpu": "-DROWS=4 -DPANELS=1", "gpu": "-DRM=8 -DRN=8 -DUNROLL=8"}[flavour]
            self.assertTrue(any(wanted in o for o in options), options)

    @support.slow
    def test_a_fast_wrong_candidate_is_not_taken(self):
        """Half of the products are skipped in every loop of an odd unrolling: the fastest set, and wrong. In the quick tests: TuneCase.FindsWhatIsWrong."""
        folder = self.path("cl")
        shutil.copytree(CL, folder)
        path = os.path.join(folder, "dense", "tile_gpu.clh")
        text = pathlib.Path(path).read_text()
        loop = "for (int s = 0; s < BK; ++s) {"
        self.assertEqual(text.count(loop), 1)
        fast = "#if defined(UNROLL) && UNROLL == 2\n  for (int s = 0; s < BK / 8; ++s) {\n#else\n  " + loop + "\n#endif"
        self.assertIn("TILE_UNROLL\n  " + loop, text)
        pathlib.Path(path).write_text(text.replace("TILE_UNROLL\n  " + loop, fast))
        env = self.tune_environment(VSPLAT_KERNEL_DIR=folder)
        said = ""
        for _ in range(60):  # its progress within the time limit is unknown
            result, err = self.tune("--model", self.model, "--for", "reconstruct", "--seconds", 3, "--kernels", "gpu", env=env)
            said += err
            wrong = [one for one in result["refused"] if one["op"] in ("gemm", "conv3d")]
            if len(wrong) > 1:
                break
        for one in result["refused"]:
            self.assertEqual((one["verdict"], one["set"]["unroll"]), ("wrong", 2), one)
            self.assertGreater(one["error"], 1e-2)
            shape = " ".join(f"{name}={value}" for name, value in one["shape"].items())
            self.assertRegex(said, re.escape(f"{one['op']} {shape}, ") + r"(scratch=\d+ )?tile=\d+ unroll=2( split=\d)?: refused: off by [0-9.e+-]+ of the largest value")
        self.assertGreater(len(wrong), 1)
        _, table = self.table()
        tried = [t for t in table["tried"] if t["set"].get("unroll") == 2]
        self.assertEqual({t["verdict"] for t in tried}, {"wrong"})
        self.assertEqual([one for one in table["chosen"] if one["set"].get("unroll") == 2], [])
        # The table for these kernels is separate from the product's, since the hash of the sources differs.
        _, err = self.succeeds(*self.reconstruct("--kernels", "gpu"), env=self.tune_environment())
        self.assertNotIn("tuned", err)

    def test_where_nothing_is_right_it_says_so(self):
        folder = self.path("cl")
        shutil.copytree(CL, folder)
        path = os.path.join(folder, "render", "radix_sort.cl")
        text = pathlib.Path(path).read_text()
        right = "out_values[to] = values ? values[i] : i;"
        self.assertIn(right, text)
        pathlib.Path(path).write_text(text.replace(right, "out_values[to] = 0;"))
        result, err = self.tune("--model", self.model, "--for", "render", "--seconds", 60, env=self.tune_environment(VSPLAT_KERNEL_DIR=folder), code=1)
        self.assertTrue(result["not_right"])
        self.assertTrue(all(name.startswith("radix_sort ") for name in result["not_right"]))
        # For other operations a set may be faster than the default, and then there is a table.
        self.assertEqual([one for one in result["chosen"] if one["op"] == "radix_sort"], [])
        self.assertIn("no set of parameters is right", err)

    def test_killed_it_loses_nothing(self):
        process = subprocess.Popen([support.VSPLAT, "tune", "--model", self.model, "--for", "reconstruct", "--seconds", "100"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **self.tune_environment()})
        finished = lambda: [t for t in self.table()[1]["tried"] if t["verdict"] != "begun"] if tables(self.path("cache")) else []
        until = time.time() + 120
        while len(finished()) < 4 and time.time() < until:
            self.assertIsNone(process.poll(), "it ended too early to be killed")
            time.sleep(0.05)
        code, _, err = support.run("tune", "--model", self.model, "--for", "reconstruct", env=self.tune_environment())
        self.assertEqual(code, 1)
        self.assertIn("another process", err)
        process.send_signal(signal.SIGKILL)
        process.wait()
        before = finished()
        self.assertGreaterEqual(len(before), 4)
        self.assertEqual(os.stat(self.path("cache")).st_mode & 0o77, 0, "a cache's folder is its owner's alone")
        result, _ = self.tune("--model", self.model, "--for", "reconstruct", "--seconds", 2)
        after = finished()
        self.assertEqual(sets_of(after)[:len(before)], sets_of(before))
        self.assertEqual(len(after), len(before) + result["tried"])

    def test_stopped_it_keeps_what_was_tried(self):
        path = self.path("stopped.json")
        process = subprocess.Popen([support.VSPLAT, "tune", "--model", self.model, "--for", "reconstruct", "--output", path],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env={**os.environ, **self.tune_environment()})
        while not os.path.exists(path) and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 128 + signal.SIGTERM, err)
        self.assertIn("another run continues from there", err)
        with open(path) as f:
            self.assertNotIn("begun", f.read())

    def test_what_it_refuses(self):
        self.refuses(2, ["--quick", "--full"], "tune", "--quick", "--full")
        self.refuses(2, ["--for", "\"draw\" is none of"], "tune", "--for", "draw")
        self.refuses(2, ["--seconds"], "tune", "--full", "--seconds", 3)
        self.refuses(2, ["--output"], "tune", "--model", self.model, env={"VSPLAT_CACHE_DIR": "off"})
        self.tune("--model", self.model, "--for", "reconstruct", "--seconds", 1e-9, "--kernels", "gpu", "--output", self.path("gpu.json"))
        # A refused set has a reason, whatever was stored about it; a set that does not fit into memory is not refused.
        kept = json.loads(pathlib.Path(self.path("gpu.json")).read_text())
        line = {"op": "gemm", "shape": {"m": 64, "n": 8, "k": 8, "taps": 1}, "set": {"tile": 64, "unroll": 0, "split": 1}, "seconds": 0, "against": 0}
        lines = [{**line, "verdict": "wrong", "error": 1e30}, {**line, "set": {**line["set"], "split": 8}, "verdict": "failed", "error": 0}]
        out, _ = self.succeeds("tune", "--model", self.model, "--for", "reconstruct", "--seconds", 1e-9, "--kernels", "gpu",
                               "--output", self.write("kept.json", {**kept, "tried": lines}), env=self.tune_environment())
        self.assertIn("refused, wrong: some values are no numbers\n", out)
        self.assertIn("refused, it does not run\n", out)
        result, err = self.tune("--for", "render", "--seconds", 2, "--max-memory", 0.005)
        self.assertIn("not tried: ", err)
        self.assertEqual((result["refused"], result["not_right"]), ([], []), err)
        of_gpu = {"VSPLAT_TUNING": self.path("gpu.json")}
        self.refuses(2, [self.path("gpu.json"), "VSPLAT_TUNING", "gpu kernels", "cpu kernels", "VSPLAT_TUNING=off"],
                     *self.reconstruct("--kernels", "cpu"), env=of_gpu)
        table = json.loads(pathlib.Path(self.path("gpu.json")).read_text())
        bad = with_choice(table, {"op": "gemm", "shape": {"m": 64, "n": 8, "k": 8, "taps": 1}, "set": {"tile": 96, "unroll": 0, "split": 1}})
        for wrong, words in ((bad, ["chosen[0].set.tile is 96", "one of 0, 64, 128"]), ({**table, "version": 9}, ["version is 9"])):
            self.refuses(1, [self.path("bad.json"), *words], *self.reconstruct("--kernels", "gpu"),
                         env={"VSPLAT_TUNING": self.write("bad.json", wrong)})
        self.refuses(1, [self.path("none.json")], *self.reconstruct(), env={"VSPLAT_TUNING": self.path("none.json")})


class Training(Tuned, train_support.Case):
    def test_a_training_goes_on_with_its_table_or_not_at_all(self):
        model = self.path("model.safetensors")
        support.run("init", "micro", "--seed", 3, "--output", model, "--quiet")
        self.tune("--model", model, "--for", "train", "--seconds", 1e-9, "--output", self.path("empty.json"), "--kernels", "cpu")
        empty = json.loads(pathlib.Path(self.path("empty.json")).read_text())
        table = with_choice(empty, {"op": "gemm_transposed", "shape": {"rows": 64, "m": 16, "n": 16}, "set": {"terms": 512, "block": 1}})
        cpu, tuned = ("--kernels", "cpu"), self.tune_environment(VSPLAT_TUNING=self.write("table.json", table))
        off = self.tune_environment(VSPLAT_TUNING="off")
        two, four = self.config("two.json", steps=2), self.config("four.json", steps=2)
        out, _ = self.succeeds(*self.train(two, "run", "--json", *cpu), env=tuned)
        self.assertEqual(json.loads(out)["tuning"], table["hash"])
        with open(self.path("run", "record.json")) as f:
            self.assertEqual([part["tuning"] for part in json.load(f)["parts"]], [table["hash"]])
        err = self.refuses(2, [self.path("run"), table["hash"][:12], "no table of tuned parameters", "VSPLAT_TUNING"],
                           *self.train(four, "run", "--resume", "--extend", 2, *cpu), env=off)
        self.assertNotIn("terminate", err)
        self.succeeds(*self.train(four, "run", "--resume", "--extend", 2, *cpu), env=tuned)
        # The other way round, too; if the table of the started training is stored, the error says where.
        self.succeeds(*self.train(two, "plain", *cpu), env=off)
        self.refuses(2, [table["hash"][:12], "VSPLAT_TUNING=off"], *self.train(four, "plain", "--resume", "--extend", 2, *cpu), env=tuned)
        os.makedirs(self.path("cache", "tuning"), exist_ok=True)
        kept = self.path("cache", "tuning", f"table-{table['hash']}.json")
        shutil.copy(self.path("table.json"), kept)
        self.refuses(2, [f"VSPLAT_TUNING={kept}"], *self.train(four, "run", "--resume", "--extend", 2, *cpu), env=off)


if __name__ == "__main__":
    support.main()
