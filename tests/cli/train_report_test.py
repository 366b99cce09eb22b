"""The page of one run or of several: written during the training, self-contained, and never the cause of a training's end."""
import json
import os
import re
import signal
import time

import support
import train_support


class Report(train_support.Case):
    def page(self, *parts):
        """Returns the page's data for its script."""
        text = self.read(*parts).decode()
        self.assertNotRegex(text, r"(?i)<link|<iframe|@import|src=.?http|href=")
        return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S).group(1))

    def steps(self, run):
        return [step for stage in run["stages"] for step in stage["log"]["columns"]["step"]]

    def test_of_a_run(self):
        config = self.config(steps=4, sheet_every=2, procedural=0.5)
        out, err = self.succeeds(*self.train(config, "run", "--json"))
        self.assertIn("report " + self.path("run", "report.html"), err)
        data = self.page("run", "report.html")
        (run,) = data["runs"]
        (stage,) = run["stages"]
        self.assertEqual((run["name"], data["notes"], self.steps(run)), ("run", [], [1, 2, 3, 4]))
        self.assertEqual([sheet["step"] for sheet in run["sheets"]], [2, 4])
        self.assertEqual(stage["config"]["procedural"], 0.5)
        for column in ("loss", "psnr", "psnr_coarse", "selected", "lr", "temperature", "seconds"):
            self.assertEqual(stage["log"]["columns"][column], [float(line[column]) for line in self.log("run")], column)
        self.assertEqual(stage["record"]["data"], [{"path": self.solids, "objects": 3}])
        (part,) = stage["record"]["parts"]
        self.assertEqual((part["first"], part["last"], part["peak_bytes"]), (0, 4, json.loads(out)["peak_bytes"]))
        self.assertTrue(part["device"] and part["driver"])

    def test_while_it_trains_and_after(self):
        """The page exists before the end, covers all stages, and is written again however a training ends."""
        config = self.config(stages=[{"steps": 4}, {"steps": 100000}], checkpoint_every=2)
        process = self.start(*self.train(config, "run"))
        while not os.path.exists(self.path("run", "report.html")) or not os.path.exists(self.path("run", "stage-2", "checkpoint-00000004.safetensors")):
            self.assertIsNone(process.poll())
            time.sleep(0.005)
        self.assertGreater(len(self.steps(self.page("run", "report.html")["runs"][0])), 0)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
        data = self.page("run", "report.html")
        (run,) = data["runs"]
        self.assertEqual([data["notes"], len(run["stages"])], [[], 2])
        done = len(self.log(os.path.join("run", "stage-2")))
        self.assertEqual(self.steps(run), [1, 2, 3, 4, *range(1, done + 1)])
        self.assertEqual(run["stages"][1]["record"]["parts"][0]["last"], done)

    def test_of_several(self):
        self.succeeds(*self.train(self.config(), "a"))
        self.succeeds(*self.train(self.config("other.json", lr=1e-3), "b"))
        page = self.path("pages", "both.html")
        runs = [self.path("a"), self.path("b")]
        out, err = self.succeeds("train", "--compare", *runs, "--output", page, "--json")
        self.assertEqual(json.loads(out), {"output": page, "runs": runs})
        data = self.page("pages", "both.html")
        self.assertEqual([run["name"] for run in data["runs"]], ["a", "b"])
        self.assertEqual([run["config"]["lr"] for run in data["runs"]], [4e-4, 1e-3])
        self.assertEqual([self.steps(run) for run in data["runs"]], [[1, 2, 3, 4, 5, 6]] * 2)
        # An old run that has only a log; and a log that was cut off.
        for name in ("config.json", "record.json", "report.html"):
            os.remove(self.path("a", name))
        with open(self.path("a", "log.csv"), "a") as f:
            f.write("7,1")
        self.refuses(1, [page, "--overwrite"], "train", "--compare", *runs, "--output", page)
        self.succeeds("train", "--compare", *runs, "--output", page, "--overwrite")
        data = self.page("pages", "both.html")
        self.assertEqual(self.steps(data["runs"][0]), [1, 2, 3, 4, 5, 6])
        self.assertIn("log.csv: 1 of its lines", data["notes"][0])

    def test_what_is_wrong_with_a_comparison(self):
        self.succeeds(*self.train(self.config(), "a"))
        page = self.path("new", "page.html")
        wrong = lambda code, words, *arguments: self.refuses(code, words, "train", *arguments)
        wrong(1, [self.path("none"), "folder"], "--compare", self.path("a"), self.path("none"), "--output", page)
        wrong(1, [self.solids, "config.json", "log.csv"], "--compare", self.solids, "--output", page)
        wrong(2, ["--compare", "--output"], "--compare", self.path("a"))
        wrong(2, ["--output", ".html"], "--compare", self.path("a"), "--output", self.path("page.txt"))
        wrong(2, ["--compare", "CONFIG"], self.config(), "--compare", self.path("a"), "--output", page)
        for more in (("--data", self.solids), ("--resume",), ("--dry-run",), ("--print-config",), ("--profile", self.path("p.json"))):
            wrong(2, ["--compare", more[0]], "--compare", self.path("a"), "--output", page, *more)
        self.assertFalse(os.path.exists(self.path("new")))
        os.rename(self.path("a", "log.csv"), self.path("log.html"))
        os.symlink(self.path("log.html"), self.path("a", "log.csv"))
        wrong(2, ["log.csv", "cannot be the output"], "--compare", self.path("a"), "--output", self.path("log.html"), "--overwrite")

    def test_a_training_goes_on_without_it(self):
        process = self.start(*self.train(self.config(steps=60), "broken"))
        while not os.path.exists(self.path("broken", "config.json")):
            self.assertIsNone(process.poll())
            time.sleep(0.001)
        while not os.path.isdir(self.path("broken", "report.html")):  # so no page can be written there
            if os.path.exists(self.path("broken", "report.html")):
                os.remove(self.path("broken", "report.html"))
            try:
                os.mkdir(self.path("broken", "report.html"))
            except FileExistsError:  # the page was written meanwhile
                pass
        err = process.communicate(timeout=120)[1]
        self.assertEqual(process.returncode, 0, err)
        self.assertRegex(err, r"warning: .*report\.html.*; the training goes on without it")
        self.assertEqual(len(self.log("broken")), 60)
        self.assertTrue(os.path.exists(self.path("broken", "model.safetensors")))


if __name__ == "__main__":
    support.main()
