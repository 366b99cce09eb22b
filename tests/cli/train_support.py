"""Shared by the tests of training: data, configurations, and the files of a run."""
import csv
import json
import os
import shutil
import subprocess
import tempfile

import support


class Case(support.FolderCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp(prefix="vsplat-train-")
        cls.addClassCleanup(shutil.rmtree, cls.shared, True)
        cls.solids = os.path.join(cls.shared, "solids")
        code, _, err = support.run("dataset", "procedural", "--count", 3, "--solids", "--views", 8, "--size", 16, "--seed", 5, "--output", cls.solids)
        assert code == 0, err

    def config(self, name="train.json", **fields):
        path = self.path(name)
        with open(path, "w") as f:
            json.dump({"model": "micro", "steps": 6, "warmup": 2, "log_every": 1, "sheet_every": 0, "checkpoint_every": 2, **fields}, f)
        return path

    def train(self, config, run, *more, data=None):
        return ("train", config, "--data", data or self.solids, "--output", self.path(run), *more)

    def read(self, *parts):
        with open(self.path(*parts), "rb") as f:
            return f.read()

    def log(self, run):
        """Returns the lines of log.csv as dictionaries."""
        with open(self.path(run, "log.csv")) as f:
            return list(csv.DictReader(f))

    def same_training(self, first, second, step):
        """The files of that step are the same bytes in both runs, and the logs are equal except for times."""
        for name in ("model.safetensors", f"checkpoint-{step:08d}.safetensors"):
            self.assertEqual(self.read(first, name), self.read(second, name), name)
        logs = [[{k: v for k, v in line.items() if k != "seconds"} for line in self.log(run)] for run in (first, second)]
        self.assertEqual(*logs)
        self.assertEqual([int(line["step"]) for line in logs[0]], list(range(1, step + 1)))

    def start(self, *arguments, **options):
        return subprocess.Popen([support.VSPLAT, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **options)
