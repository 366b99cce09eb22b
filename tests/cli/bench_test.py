"""vsplat bench, which a program of its own runs: verdicts of --compare, warnings, signals, and where the program is not there."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import unittest

import support


def has_pytorch():
    return subprocess.run(["/usr/bin/python3", "-c", "import torch"], capture_output=True).returncode == 0


class Bench(support.Case):
    RUN = ("bench", "model", "--run", "tiny", "--seconds", "0.05")

    def changed(self, name, report, factor):
        report = json.loads(json.dumps(report))
        for result in report["results"]:
            result["median_s"] *= factor
            result["spread"] = 0.0
        with open(self.path(name), "w") as f:
            json.dump(report, f)
        return self.path(name)

    def test_compare(self):
        out, _ = self.succeeds(*self.RUN, "--json")
        report = json.loads(out)
        self.assertEqual([(r["suite"], r["name"], r["kind"]) for r in report["results"]], [("model", "tiny", "network")])
        stages = report["results"][0]["by_stage"]
        self.assertEqual(sorted(stages[0]), ["gbs", "gflops", "limit", "limit_s", "performed_gflops", "seconds", "share_of_limit", "stage"])
        self.assertIn("volume", [s["stage"] for s in stages])
        self.assertNotIn("references", report)

        # An earlier run that was a hundred times as fast: the case is now slower beyond any noise.
        was_fast, was_slow = self.changed("fast.json", report, 0.01), self.changed("slow.json", report, 1000)
        out, _ = self.succeeds(*self.RUN, "--compare", was_fast)
        self.assertRegex(out, r"model/tiny +.*slower\n")
        code, out, err = support.run(*self.RUN, "--compare", was_fast, "--fail-above", "50%")
        self.assertEqual(code, 1, err)
        self.assertRegex(err, r"slower by more than 50%: model/tiny \+")
        self.assertIn("slower", out)  # the table is printed, too
        out, _ = self.succeeds(*self.RUN, "--compare", was_slow, "--fail-above", "0%", "--json")
        compared = json.loads(out)["compared"]
        self.assertEqual([c["verdict"] for c in compared["cases"]], ["faster"])
        self.assertEqual(compared["file"], was_slow)

    def python(self, script):
        """An environment whose python3 is this script."""
        folder = self.path("bin")
        os.makedirs(folder, exist_ok=True)
        path = os.path.join(folder, "python3")
        with open(path, "w") as f:
            f.write("#!/bin/sh\n" + script)
        os.chmod(path, 0o755)
        return {"PATH": folder + os.pathsep + os.environ["PATH"]}

    def test_the_network_in_pytorch(self):
        output = self.path("output")
        says = f"echo a warning >&2; echo $* >{output}; echo '{json.dumps({'version': '9.9', 'fp32': 0.5, 'bf16': 0.25})}'"
        out, _ = self.succeeds(*self.RUN, "--references", "--json", env=self.python(says))
        self.assertRegex(pathlib.Path(output).read_text(), r"/pytorch_forward\.py tiny [1-9]\d* 0\.05")
        reference = json.loads(out)["results"][0]["reference"]
        self.assertEqual({k: v for k, v in reference.items() if "PyTorch" in k}, {"PyTorch 9.9 fp32": 0.5, "PyTorch 9.9 bf16": 0.25})
        out, err = self.succeeds(*self.RUN, "--references", "--json", env=self.python("echo No module named torch; exit 1"))
        self.assertIn("model/tiny: without PyTorch: No module named torch", err)
        _, err = self.succeeds(*self.RUN, "--references", "--json", env=self.python("echo no JSON"))
        self.assertIn("model/tiny: without PyTorch: no JSON", err)
        self.assertNotIn("PyTorch", str(json.loads(out)["results"]))

    @unittest.skipUnless(has_pytorch(), "python3-torch is not installed")
    def test_pytorch_itself(self):
        out, _ = self.succeeds(*self.RUN, "--references", "--json", env={"PATH": "/usr/bin:/bin"})
        seconds = [v for k, v in json.loads(out)["results"][0]["reference"].items() if "PyTorch" in k]
        self.assertEqual(len(seconds), 2)
        self.assertGreater(min(seconds), 1e-4)

    def test_warnings_are_printed(self):
        cache = self.path("cache")
        os.mkdir(cache)
        os.chmod(cache, 0o777)  # what others may write to is not used, of which the library warns
        _, err = self.succeeds(*self.RUN, "--quiet", env={"VSPLAT_CACHE_DIR": cache, "VSPLAT_TUNING": "", "VSPLAT_SELFTEST": ""})
        self.assertRegex(err, f"warning: {cache}: others may write to this folder")
        self.assertEqual(err.count("warning: "), 1, err)

    def test_a_stop(self):
        command = subprocess.Popen([support.VSPLAT, "bench", "conv3d", "--run", "small", "--seconds", "60"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.assertIn("device ", command.stderr.readline())
        command.send_signal(signal.SIGINT)
        out, err = command.communicate(timeout=support.PATIENCE)
        self.assertEqual((command.returncode, out), (130, ""), err)
        self.assertIn("vsplat: stopped\n", err)

    def test_without_the_program(self):
        library = os.environ["VSPLAT_LIBRARY"]
        os.makedirs(self.path("lib"))
        name = os.path.basename(os.path.realpath(library))
        shutil.copy(library, self.path("lib", name))
        os.symlink(name, self.path("lib", ".".join(name.split(".")[:3])))
        env = {"LD_LIBRARY_PATH": self.path("lib")}
        self.refuses(1, [self.path("libexec", "vsplat", "vsplat-bench"), "cannot be started", "installed with the command"], *self.RUN, env=env)
        self.refuses(2, "--secnds", "bench", "--secnds", "1", env=env)  # arguments are checked first
        self.assertIn("--fail-above", self.succeeds("bench", "--help", env=env)[0])

    def test_refusals(self):
        with open(self.path("other.json"), "w") as f:
            json.dump({"device": "x"}, f)
        self.refuses(1, ["other.json", "driver"], *self.RUN, "--compare", self.path("other.json"))
        self.refuses(2, "nowhere.json", *self.RUN, "--compare", self.path("nowhere.json"))
        self.refuses(2, ["--fail-above", "--compare"], *self.RUN, "--fail-above", "5%")
        self.refuses(2, "--fail-above", *self.RUN, "--compare", self.path("other.json"), "--fail-above", "x")


if __name__ == "__main__":
    support.main()
