"""What a GPU is asked first, tried on the device there is: bench/gpu-first-hour.sh, as it is in the source tree and out of what cmake/bundle.sh
packs."""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tarfile
import time
import unittest

import support

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "bench/gpu-first-hour.sh"
DEVICE = os.environ.get("VSPLAT_DEVICE") or "cpu"
STEPS = ["doctor", "selftest", "tests", "tune", "paper", "mixed", "bench"]

# In place of vsplat: does what the file of the variable STAND_IN tells, and notes each call there.
STAND_IN = r"""#!{python}
import json, os, sys, time
reported = json.load(open(os.environ["STAND_IN"]))
words = sys.argv[1:]
with open(os.environ["STAND_IN"] + ".calls", "a") as f:
    f.write(json.dumps([words, os.environ.get("OCL_ICD_VENDORS", ""), os.environ.get("VSPLAT_TUNING", "")]) + "\n")
unfit = os.environ.get("VSPLAT_SELFTEST") != "ignore" and reported["verdict"] == "unusable"
after = lambda option: words[words.index(option) + 1]
command = words[0]
if command == "help":
    if words[1] in reported["lacks"]:
        sys.exit(2)
    if words[1] == "reconstruct":
        print("  --precision fp32|mixed" if "mixed" not in reported["lacks"] else "")
    sys.exit(0)
if command == "--version":
    print("vsplat of a test")
elif command == "devices" and "--json" in words:
    print(json.dumps([dict(type=reported["type"])], indent=1))
elif command == "bench" and words[1] == "none":
    print("vsplat: suites: none not in {{scan,gemm,conv3d}}", file=sys.stderr)
    sys.exit(2)
if command in reported["hangs"]:
    time.sleep(600)
if command == "selftest":
    print(json.dumps(dict(verdict=reported["verdict"], flavours=[dict(verdict="wrong")]), indent=1))
    print(f"vsplat: a device: {{reported['verdict']}}", file=sys.stderr)
    sys.exit(1 if unfit else 0)
if command in reported["fails"] or unfit and command not in ("devices", "doctor"):
    print(f"vsplat: {{command}} failed", file=sys.stderr)
    sys.exit(1)
for option in ("--output", "--profile"):
    if option in words and command != "dataset":
        with open(after(option), "w") as f:
            f.write(json.dumps(dict(wall=dict(device_s=0.125)), indent=1))
        if option == "--profile" and command == "bench":
            with open(after(option) + ".large", "wb") as f:
                f.write(os.urandom(reported["large"]))
if command == "dataset":
    os.makedirs(after("--output") + "/solid_0000")
elif command == "weights":
    print(json.dumps(dict(config=dict(image=16, volume=4)), indent=1))
elif command in ("reconstruct", "tune", "render", "bench"):
    tuning = None if os.environ.get("VSPLAT_TUNING") == "off" else "ab12"
    print(json.dumps(dict(seconds=1.5, tried=7, psnr=60.5, tuning=tuning), indent=1))
"""


class Case(support.FolderCase):
    def setUp(self):
        super().setUp()
        self.output = self.path("out")

    def script(self, *arguments, script=SCRIPT, env=None, timeout=1500):
        """-> exit code, stderr"""
        done = subprocess.run([str(script), *map(str, arguments)], capture_output=True, text=True, timeout=timeout, cwd=self.folder, check=False,
                              env={**os.environ, **(env or {})})
        self.assertEqual(done.stdout, "", done.stderr)
        return done.returncode, done.stderr

    def summary(self):
        """-> {step: (result, what is noted)}, in its order; and what holds for every result"""
        with open(os.path.join(self.output, "summary.txt")) as f:
            rows = [line.rstrip("\n").split("\t") for line in f]
        files = os.listdir(self.output)
        self.assertEqual(sorted(files), sorted(["summary.txt"] + [row[0] + ".tar.gz" for row in rows]))
        self.assertLessEqual(len(files), 8)
        for name in files:
            self.assertLess(os.path.getsize(os.path.join(self.output, name)), 16 << 20)
        return {row[0]: (row[1], row[3]) for row in rows}

    def packed(self, step):
        """-> {name: bytes}"""
        with tarfile.open(os.path.join(self.output, step + ".tar.gz")) as tar:
            return {m.name.split("/", 1)[1]: tar.extractfile(m).read() for m in tar.getmembers() if m.isfile()}


class StandIn(Case):
    """With a program in place of vsplat: which steps are done, and what becomes of those that fail, hang or are stopped."""

    def setUp(self):
        super().setUp()
        with open(self.path("vsplat"), "w") as f:
            f.write(STAND_IN.format(python=sys.executable))
        os.chmod(self.path("vsplat"), 0o755)

    def environment(self, env=None, **reported):
        with open(self.path("reported"), "w") as f:
            json.dump({"type": "gpu", "lacks": [], "fails": [], "hangs": [], "large": 0, "verdict": "ok", **reported}, f)
        pathlib.Path(self.path("reported.calls")).unlink(missing_ok=True)
        return {"VSPLAT": self.path("vsplat"), "STAND_IN": self.path("reported"), "OCL_ICD_VENDORS": "", "OCL_ICD_FILENAMES": "", "VSPLAT_TUNING": "",
                **(env or {})}

    def calls(self):
        with open(self.path("reported.calls")) as f:
            return [json.loads(line) for line in f]

    def on(self, *arguments, env=None, **reported):
        return self.script("--tests", "None.*", *arguments, env=self.environment(env, **reported))

    def test_all_steps(self):
        code, err = self.on(self.output)
        self.assertEqual(code, 0, err)
        summary = self.summary()
        self.assertEqual(list(summary), STEPS)
        self.assertEqual({step: result for step, (result, _) in summary.items() if step != "tests"}, {step: "ok" for step in STEPS if step != "tests"})
        self.assertIn("paper-tuned, second time: 1.500 s, of them 0.1250 on the device", summary["paper"][1])
        self.assertIn("paper, table: null;", summary["paper"][1])
        self.assertIn("paper-tuned, table: ab12", summary["paper"][1])
        # Tuned is what is measured then, and for as long as there is time.
        [tune] = [words for words, _, _ in self.calls() if words[0] == "tune"]
        [model] = {words[words.index("--model") + 1] for words, _, _ in self.calls() if words[0] in ("reconstruct", "tune")}
        self.assertTrue(model.endswith("/paper.safetensors"), model)
        self.assertTrue(400 < int(tune[tune.index("--seconds") + 1]) <= 450, tune)
        self.assertIn("mixed against fp32: 60.5 dB", summary["mixed"][1])
        self.assertIn("3 suites, 0 failed, 0 without time", summary["bench"][1])
        self.assertEqual([words[1] for words, _, _ in self.calls() if words[0] == "bench" and "--json" in words], ["gemm", "conv3d", "scan"])
        paper = [(words, tuning) for words, _, tuning in self.calls() if words[0] == "reconstruct"][:4]
        self.assertEqual([tuning for _, tuning in paper], ["off", "off", "", ""])
        for words, _ in paper:
            for option, value in (("--view-count", "4"), ("--render", "orbit:8"), ("--device", "gpu")):
                self.assertEqual(words[words.index(option) + 1], value)
        self.assertIn("commands.txt", self.packed("paper"))

    def test_a_verdict_ends_no_step_that_follows(self):
        code, err = self.on("--suites", "gemm", self.output, "selftest", "tune", "bench", verdict="unusable")
        self.assertEqual(code, 1, err)
        summary = self.summary()
        self.assertEqual([summary[step][0] for step in ("selftest", "tune", "bench")], ["failed", "ok", "ok"], summary)
        self.assertIn("verdict: unusable", summary["selftest"][1])

    def test_steps_survive_each_other_and_can_be_called_alone(self):
        code, err = self.on(self.output, fails=["reconstruct", "doctor"], lacks=["selftest", "mixed"])
        self.assertEqual(code, 1, err)
        summary = self.summary()
        self.assertEqual([summary[step][0] for step in ("doctor", "selftest", "tune", "paper", "mixed", "bench")],
                         ["ok", "skipped", "ok", "failed", "skipped", "ok"])
        self.assertIn("vsplat: reconstruct failed", summary["paper"][1])
        code, err = self.on(self.output, "paper")
        self.assertEqual(code, 0, err)
        self.assertEqual([words[0] for words, _, _ in self.calls() if words[0] in ("doctor", "bench", "tune")], [])
        again = self.summary()
        self.assertEqual((again["paper"][0], again["bench"], len(again)), ("ok", summary["bench"], 7))

    def test_a_step_that_hangs_is_ended(self):
        begun = time.monotonic()
        code, err = self.on("--minutes", 0.1, "--suites", "gemm", self.output, "tune", "bench", hangs=["tune"])
        self.assertEqual(code, 1, err)
        self.assertLess(time.monotonic() - begun, 60)
        summary = self.summary()
        self.assertEqual((summary["tune"][0], summary["bench"][0]), ("late", "ok"))

    def test_what_is_too_large_is_left_out(self):
        code, err = self.on("--suites", "gemm", self.output, "bench", large=17 << 20)
        self.assertEqual(code, 0, err)
        self.assertIn("left out: bench-gemm.json.large", self.summary()["bench"][1])
        self.assertIn("bench-gemm.out", self.packed("bench"))

    def test_stopped_it_leaves_what_there_is(self):
        process = subprocess.Popen([str(SCRIPT), self.output, "doctor", "tune", "bench"], stderr=subprocess.PIPE, text=True, cwd=self.folder,
                                   env={**os.environ, **self.environment(hangs=["tune"])})
        for line in process.stderr:
            if "tune: at most" in line:
                break
        time.sleep(1)
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, err)
        self.assertEqual({step: result for step, (result, _) in self.summary().items()}, {"doctor": "ok", "tune": "failed"})

    def test_a_driver_without_an_entry_gets_one(self):
        os.mkdir(self.path("driver"))
        library = pathlib.Path(self.path("driver", "libnvidia-opencl.so.1"))
        library.touch()
        code, err = self.on(self.output, "doctor", env={"LD_LIBRARY_PATH": self.path("driver")})
        self.assertEqual(code, 0, err)
        vendors = [vendors for words, vendors, _ in self.calls() if words[0] == "doctor"]
        self.assertEqual(vendors, ["", self.output + ".work/vendors", self.output + ".work/vendors"], err)  # as it was found, and as it is used
        self.assertEqual(pathlib.Path(self.output + ".work/vendors/nvidia.icd").read_text(), f"{library}\n")

    def test_without_a_gpu_the_doctor_is_asked(self):
        code, err = self.on(self.output, type="cpu")
        self.assertEqual(code, 1, err)
        self.assertEqual({result for step, (result, _) in self.summary().items() if step != "doctor"}, {"skipped"})
        self.assertIn("no GPU among the devices", self.summary()["paper"][1])
        self.assertIn("doctor.out", self.packed("doctor"))

    def test_wrong_options(self):
        for words, arguments in {"OUTPUT is missing": [], "dance is no step: there are doctor selftest": [self.output, "dance"], "--what is no option": ["--what"],
                                 "--minutes is \"x\"": ["--minutes", "x", self.output], "--device needs a value": [self.output, "--device"]}.items():
            code, err = self.on(*arguments)
            self.assertEqual(code, 2, err)
            self.assertIn(words, err)
        self.assertFalse(os.path.exists(self.output))


class FirstHour(Case):
    SHORT = ["--minutes", "3", "--device", DEVICE, "--config", "micro", "--search", "5", "--suites", "scan,layernorm", "--seconds", "0.02", "--tests", "LayerNorm*:Doctor*"]

    def hold(self, code, err, tests):
        self.assertEqual(code, 0, err)
        summary = self.summary()
        self.assertEqual(list(summary), STEPS)
        for step in ("doctor", "tune", "paper", "bench"):
            self.assertEqual(summary[step][0], "ok", err)
        if tests:
            self.assertEqual(summary["tests"][0], "ok", err)
            self.assertRegex(summary["tests"][1], r"ops_tests: 0 failed, [1-9]\d* passed")
        report = json.loads(self.packed("doctor")["report.json"])
        self.assertGreater(report["run"]["check"]["psnr"], report["run"]["check"]["psnr_nearest"])
        paper = self.packed("paper")
        table = json.loads(self.packed("tune")["tune.out"])["table"] or None
        self.assertEqual([json.loads(paper[f"micro{tuned}-second.out"])["tuning"] for tuned in ("", "-tuned")], [None, table])
        self.assertEqual(sorted(n for n in paper if n.startswith("micro-tuned/")), [f"micro-tuned/{i:04}.png" for i in range(8)])
        self.assertEqual(json.loads(paper["micro-first.out"])["views"], 4)
        self.assertGreater(json.loads(paper["micro-tuned-second.json"])["wall"]["device_s"], 0)
        self.assertEqual(json.loads(self.packed("bench")["bench-scan.out"])["results"][0]["suite"], "scan")

    def test_in_the_tree(self):
        code, err = self.script(*self.SHORT, self.output)
        self.hold(code, err, os.path.exists(os.path.join(os.path.dirname(os.environ["VSPLAT"]), "../tests/ops_tests")))

    @unittest.skipUnless(os.environ.get("VSPLAT_BUNDLE"), "VSPLAT_BUNDLE names no build to pack")
    def test_out_of_the_bundle(self):
        """Which is small enough, unpacked elsewhere, with an environment that names nothing."""
        done = subprocess.run([ROOT / "cmake/bundle.sh", "--build", os.environ["VSPLAT_BUNDLE"], "--no-driver", "--data", "--tests", self.path("vsplat.tar.xz")],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        with tarfile.open(self.path("vsplat.tar.xz")) as tar:
            tar.extractall(self.path("there"))
        alone = {"PATH": "/usr/sbin:/usr/bin:/bin", "HOME": self.folder}
        alone |= {name: os.environ[name] for name in ("OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "RUSTICL_ENABLE") if name in os.environ}
        got = subprocess.run([self.path("there/vsplat/bench/gpu-first-hour.sh"), *self.SHORT, self.output], capture_output=True, text=True, env=alone,
                             cwd=self.folder, check=False)
        self.hold(got.returncode, got.stderr, True)


if __name__ == "__main__":
    support.main()
