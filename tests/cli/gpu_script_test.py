"""Training for a given time on a machine that has only a driver, tried on the device there is: model/weights/train-on-a-gpu.sh, as it is in the
source tree and out of what cmake/bundle.sh packs."""
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import time
import unittest

import support

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "model/weights/train-on-a-gpu.sh"
DEVICE = os.environ.get("VSPLAT_DEVICE", "0")
CONFIG = {"model": "micro", "steps": 1000000, "procedural": 1, "log_every": 10, "sheet_every": 10, "checkpoint_every": 20}
# In place of vsplat, so that what needs a GPU, or a wrong one, can be tried: a device that gives the numbers of $STAND_IN (JSON), and a training that
# does a step every tenth of a second until it is interrupted; the first `failures` times it ends with an error after a step, and it does not
# end by itself before it was interrupted `interruptions` times.
STAND_IN = """#!{python}
import glob, json, os, signal, sys, time
device = json.load(open(os.environ["STAND_IN"]))
words = sys.argv[1:]
after = lambda option: words[words.index(option) + 1]
if "--device" in words and after("--device") not in ("gpu", "cpu"):
    sys.exit("no device is " + after("--device"))
if words[0] == "--version":
    print("vsplat of a test")
elif words[0] == "devices":
    with open(os.environ["STAND_IN"] + ".vendors", "w") as f:
        f.write(os.environ.get("OCL_ICD_VENDORS", ""))
    print(json.dumps([dict(type=device["type"])], indent=1))
elif words[0] == "dataset":
    os.makedirs(after("--output"))
elif words[0] == "evaluate":
    print("device 0: a test's", file=sys.stderr)
    device["psnr"] += device.get("drift", 0) * os.path.exists(os.environ["STAND_IN"] + ".again")
    open(os.environ["STAND_IN"] + ".again", "w").close()
    print(json.dumps(dict(mean=dict(psnr=device["psnr"], psnr_white=10.367)), indent=1))
elif words[0] == "weights":
    open(after("--output"), "w").write("weights")
elif "--print-config" in words:
    print(json.dumps(dict(model=dict(image=16), steps=1000, batch=3, accumulate=2), indent=1))
else:
    run, at = after("--output"), 0
    os.makedirs(run, exist_ok=True)
    for file in glob.glob(run + "/checkpoint-*"):
        at = max(at, int(file[-20:-12]))
    def end(code):
        for name in (f"checkpoint-{{at:08d}}.safetensors", "model.safetensors", "config.json"):
            open(run + "/" + name, "w").write(str(at) * 1000)
        open(run + "/log.csv", "w").write(f"step,seconds,lr,temperature,loss,psnr,psnr_coarse,a,b,c,gradient_norm\\n1,0,0,1,1.0084,1,1,1,1,1,{{device['gradient']}}\\n")
        sys.exit(code)
    stopped = os.environ["STAND_IN"] + ".stopped"
    interruptions = lambda: os.path.getsize(stopped) if os.path.exists(stopped) else 0
    def stop(*_):
        open(stopped, "a").write("x")
        end(130)
    signal.signal(signal.SIGINT, stop)
    at += 1
    if "--resume" not in words:
        end(0)
    left = os.environ["STAND_IN"] + ".failures"
    failures = int(open(left).read()) if os.path.exists(left) else device.get("failures", 0)
    open(left, "w").write(str(max(failures - 1, 0)))
    if failures > 0:
        end(1)
    while at < device.get("until", 1e9) or interruptions() < device.get("interruptions", 0):
        time.sleep(0.1)
        at += 1
    end(0)
"""


class Case(support.FolderCase):
    def setUp(self):
        super().setUp()
        with open(self.path("micro.json"), "w") as f:
            json.dump(CONFIG, f)

    def script(self, *arguments, script=SCRIPT, env=None):
        """-> exit code, stderr"""
        done = subprocess.run([str(script), *map(str, arguments)], capture_output=True, text=True, timeout=800, cwd=self.folder, check=False,
                              env={**os.environ, **(env or {})})
        self.assertEqual(done.stdout, "", done.stderr)
        return done.returncode, done.stderr


class StandIn(Case):
    """With a program in place of vsplat: what is found, what is refused, what is done after a failure."""

    def setUp(self):
        super().setUp()
        with open(self.path("vsplat"), "w") as f:
            f.write(STAND_IN.format(python=sys.executable))
        os.chmod(self.path("vsplat"), 0o755)

    def on(self, *arguments, env=None, **result):
        """The script on a stand-in for a device. -> exit code, stderr"""
        with open(self.path("device"), "w") as f:
            json.dump({"type": "gpu", "psnr": 24.93, "gradient": 0.0834, **result}, f)
        for ending in ("again", "failures", "stopped"):
            pathlib.Path(self.path("device." + ending)).unlink(missing_ok=True)
        return self.script(*arguments, env={"VSPLAT": self.path("vsplat"), "STAND_IN": self.path("device"), "OCL_ICD_VENDORS": "", "OCL_ICD_FILENAMES": "",
                                            **(env or {})})

    def summary(self, output):
        with open(self.path(output, "summary.json")) as f:
            return json.load(f)

    def test_a_driver_without_an_entry_gets_one(self):
        os.mkdir(self.path("driver"))
        library = pathlib.Path(self.path("driver", "libnvidia-opencl.so.1"))
        library.touch()
        code, err = self.on("--check-only", "--work", self.path("work"), env={"LD_LIBRARY_PATH": self.path("driver")})
        self.assertEqual(code, 0, err)
        vendors = pathlib.Path(pathlib.Path(self.path("device.vendors")).read_text())
        self.assertEqual(vendors, pathlib.Path(self.path("work", "vendors")), err)
        self.assertEqual((vendors / "nvidia.icd").read_text(), f"{library}\n")

    def test_wrong_devices(self):
        for words, result in {"no GPU is among": {"type": "cpu"}, "reconstructs wrongly": {"psnr": 21.5}, "gradients are wrong": {"gradient": 0.12},
                            "other numbers for the same": {"drift": 0.01}}.items():
            code, err = self.on("--check-only", **result)
            self.assertEqual(code, 1, err)
            self.assertIn(words, err)

    def test_a_piece_that_fails_once_is_done_again(self):
        code, err = self.on("--minutes", 20, "--output", self.path("out"), failures=1, until=12)
        self.assertEqual(code, 0, err)
        self.assertIn("ended with exit code 1", err)
        self.assertEqual(self.summary("out")["steps"], 12)

    def test_a_piece_is_interrupted_and_gone_on_with(self):
        code, err = self.on("--minutes", 20, "--piece", 0.02, "--output", self.path("out"), until=25, interruptions=2)
        self.assertEqual(code, 0, err)
        self.assertGreater(err.count("written into"), 2)
        self.assertGreaterEqual(self.summary("out")["steps"], 25)

    def test_objects_are_drawn_before(self):
        code, err = self.on("--minutes", 20, "--output", self.path("out"), "--work", self.path("work"), "--draw", 10, until=3)
        self.assertEqual(code, 0, err)
        self.assertEqual(sorted(os.listdir(self.path("work", "drawn"))), list("12345678"))
        with open(self.path("work", "run.json")) as f:
            self.assertEqual(json.load(f)["procedural"], 0.1)
        code, err = self.on("--minutes", 20, "--output", self.path("out"), "--from", self.path("out"), "--draw", 11)
        self.assertEqual(code, 2, err)
        self.assertIn("was begun with 10", err)

    def test_what_fails_twice_leaves_what_there_is(self):
        code, err = self.on("--minutes", 20, "--output", self.path("out"), "--part-size", 1, failures=2)
        self.assertEqual(code, 1, err)
        self.assertEqual((self.summary("out")["steps"], self.summary("out")["failed"]), (2, 1))
        # A run that continues it, into the same folder: the pieces of the old state are gone.
        code, err = self.on("--minutes", 20, "--output", self.path("out"), "--from", self.path("out"), until=7)
        self.assertEqual(code, 0, err)
        self.assertEqual((self.summary("out")["steps"], self.summary("out")["steps_here"]), (7, 5))
        self.assertEqual([name for name in os.listdir(self.path("out")) if name.startswith("state-")], ["state-00000007.part-00"])

    def test_wrong_options(self):
        for words, arguments in {"--minutes is missing": ["--output", "x"], "--output is missing": ["--minutes", 1], "--minutes is \"x\"": ["--minutes", "x",
                                 "--output", "x"], "--what is no option": ["--what"], "--from needs a value": ["--from"]}.items():
            code, err = self.on(*arguments)
            self.assertEqual(code, 2, err)
            self.assertIn(words, err)


class GpuScript(Case):
    def train(self, output, *more):
        """-> summary.json"""
        code, err = self.script("--minutes", self.minutes, "--piece", 0.1, "--output", self.path(output), "--device", DEVICE, "--init", "none",
                                "--objects", 1, "--part-size", 200, *more)
        self.assertEqual(code, 0, err)
        with open(self.path(output, "summary.json")) as f:
            return json.load(f)

    def test_goes_on_where_it_stopped(self):
        # The checks are a part of the time that is given, and take as long as this machine makes them take.
        begun = time.monotonic()
        code, err = self.script("--check-only", "--device", DEVICE)
        self.assertEqual(code, 0, err)
        self.minutes = f"{(2 * (time.monotonic() - begun) + 20) / 60:.2f}"
        first = self.train("first", "--config", self.path("micro.json"))
        self.assertGreater(first["steps"], 0)
        self.assertEqual((first["steps_here"], first["calls"], first["failed"]), (first["steps"], 1, 0))
        self.assertGreater(first["psnr_after"], 0)
        parts = sorted(p for p in os.listdir(self.path("first")) if p.startswith("state-"))
        self.assertGreater(len(parts), 1)
        for line in pathlib.Path(self.path("first", "state.sha256")).read_text().splitlines():
            digest, name = line.split()
            data = pathlib.Path(self.path("first", name)).read_bytes()
            self.assertEqual(hashlib.sha256(data).hexdigest(), digest)
            self.assertLessEqual(len(data), 200 * 1024)
        second = self.train("second", "--from", self.path("first"))
        self.assertEqual(second["steps"] - second["steps_here"], first["steps"])
        self.assertGreater(second["steps_here"], 0)
        self.assertEqual((second["calls"], second["psnr_before"], second["psnr_first"]), (2, first["psnr_after"], first["psnr_after"]))
        steps = [int(line.split(",")[0]) for line in pathlib.Path(self.path("second", "log.csv")).read_text().splitlines()[1:]]
        self.assertEqual([step for step in steps if step % 10 == 0], list(range(10, second["steps"] + 1, 10)))
        self.assertEqual(steps, sorted(set(steps)))  # between them where a piece was stopped: what follows are the means of the rest
        # A damaged state is not continued.
        with open(self.path("first", parts[-1]), "r+b") as f:
            f.write(b"damaged")
        code, err = self.script("--minutes", 1, "--output", self.path("third"), "--from", self.path("first"), "--device", DEVICE, "--objects", 1)
        self.assertEqual(code, 1)
        self.assertIn("missing or damaged", err)

    def test_no_device(self):
        code, err = self.script("--check-only", env={"OCL_ICD_VENDORS": self.path("none")})
        self.assertEqual(code, 1, err)
        for words in ("no OpenCL device", "looked at", self.path("none")):
            self.assertIn(words, err)

    @unittest.skipUnless(os.environ.get("VSPLAT_BUNDLE"), "VSPLAT_BUNDLE names no build to pack")
    def test_the_bundle_runs_alone(self):
        """Unpacked elsewhere, with an environment that names nothing; and by the C library that comes along."""
        done = subprocess.run([ROOT / "cmake/bundle.sh", "--build", os.environ["VSPLAT_BUNDLE"], "--no-driver", "--data", self.path("bundle")],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        alone = {"PATH": "/usr/bin:/bin", "HOME": self.folder}
        alone |= {name: os.environ[name] for name in ("OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "RUSTICL_ENABLE") if name in os.environ}
        command = self.path("bundle", "bin", "vsplat")
        expected = support.run("devices", "--json")[1]
        loader = next(pathlib.Path(self.path("bundle", "libc")).glob("ld-linux*"))
        carried = [str(loader), "--library-path", self.path("bundle", "libc") + ":" + self.path("bundle", "libcxx"), command + ".elf"]
        for program in ([command], carried):
            got = subprocess.run([*program, "devices", "--json"], capture_output=True, text=True, env=alone, check=False)
            self.assertEqual((got.returncode, got.stdout), (0, expected), got.stderr)
        mesh = self.path("mesh.obj")
        pathlib.Path(mesh).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        got = subprocess.run([command, "dataset", "render", mesh, "--output", self.path("set"), "--views", "1", "--size", "16"], capture_output=True, text=True,
                             env=alone, check=False)
        self.assertEqual(got.returncode, 0, got.stderr)
        done = subprocess.run([self.path("bundle", "model/weights/train-on-a-gpu.sh"), "--check-only", "--device", DEVICE], capture_output=True, text=True, env=alone,
                              check=False)
        self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    support.main()
