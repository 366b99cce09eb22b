"""vsplat report: one file with everything needed to find a defect, and nothing that identifies a person or a machine."""
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess

import support

USER = "alicexample"


class Report(support.FolderCase):
    def setUp(self):
        super().setUp()
        self.home = self.path("homes", USER)
        self.cache = os.path.join(self.home, "kept")
        os.makedirs(self.home)
        os.makedirs(os.path.join(self.cache, "verdicts"), mode=0o700)
        self.env = {"HOME": self.home, "USER": USER, "LOGNAME": USER, "VSPLAT_CACHE_DIR": self.cache, "POCL_CACHE_DIR": self.path("pocl"),
                    "LD_LIBRARY_PATH": f"{self.home}/lib:/home/somebody/lib:" + os.environ.get("LD_LIBRARY_PATH", "")}

    def report(self, *more, env=None):
        """Returns the file's JSON and its text."""
        path = self.path("report.json")
        _, err = self.succeeds("report", "--output", path, "--overwrite", *more, env={**self.env, **(env or {})})
        text = pathlib.Path(path).read_text()
        return json.loads(text), text, err

    def keep(self, name, content):
        path = os.path.join(self.cache, name)
        pathlib.Path(path).write_text(content)
        return path

    def impersonal(self, text, *others):
        for word in (USER, self.home, socket.gethostname(), "somebody", *others):
            self.assertIsNone(re.search(rf"(?<![A-Za-z0-9]){re.escape(word)}(?![A-Za-z0-9])", text), word)

    def test_it_tells_what_is_needed(self):
        host = socket.gethostname()
        verdict = {"verdict": "degraded", "off": ["gemm_tile_gpu"], "log": f"{self.home}/log of {USER} on {host}"}
        self.keep("verdicts/a.json", json.dumps(verdict))
        self.keep("verdicts/damaged.json", "{")
        self.keep("verdicts/big.json", "[" + "1," * 200000 + "1]")
        result, text, _ = self.report()
        self.assertEqual((result["format"], "vsplat " + result["version"]), ("vsplat-report", support.run("--version")[1].strip()))
        self.assertEqual(sorted(result), sorted(["format", "version", "made", "system", "environment", "doctor", "device", "run", "kept"]))
        kept = {k["file"]: k for k in result["kept"]}
        self.assertEqual(kept["verdicts/a.json"]["content"], {**verdict, "log": "~/log of USER on HOST" if host != "localhost" else verdict["log"]})
        self.assertEqual(kept["verdicts/damaged.json"]["bytes"], 1)
        self.assertNotIn("content", kept["verdicts/big.json"])
        self.assertEqual(result["environment"]["VSPLAT_CACHE_DIR"], "~/kept")
        self.assertTrue(result["environment"]["LD_LIBRARY_PATH"].startswith("~/lib:/home/USER/lib:"))
        self.assertEqual(result["doctor"]["caches"][0]["path"], "~/kept")
        # The standard run on the default device, with its profile; the peaks that it measured are included.
        device = result["device"]
        self.assertIn(device["name"], [d["name"] for d in result["doctor"]["devices"]])
        self.assertGreater(result["run"]["check"]["psnr"], result["run"]["check"]["psnr_nearest"])
        profile = result["run"]["profile"]
        self.assertEqual(profile["device"], device["name"])
        self.assertIn("gemm", " ".join(k["name"] for k in profile["kernels"]))
        self.assertGreater(profile["peaks"]["gflops"], 0)
        self.assertIn(profile["peaks"]["gflops"], [k["content"].get("gflops") for k in result["kept"] if k["file"].endswith(".bin")])
        self.impersonal(text)
        self.assertLess(len(text), 2 << 20)

    def test_a_name_that_is_a_part_of_a_fact(self):
        facts = {"device": "a vsplat of debian", "driver": "3.1+debian", "verdict": "degraded"}
        self.keep("verdicts/a.json", json.dumps({**facts, "log": "of debian"}))
        result, _, _ = self.report("--no-run", env={"USER": "debian", "LOGNAME": "vsplat", "VSPLAT_TUNING": "/data/debian/a.json"})
        as_ever, _, _ = self.report("--no-run", env={"VSPLAT_TUNING": "/data/debian/a.json"})
        self.assertEqual((result["format"], result["version"]), ("vsplat-report", as_ever["version"]))
        self.assertEqual(result["kept"][0]["content"], {**facts, "log": "of USER"})
        self.assertEqual(result["environment"]["VSPLAT_TUNING"], "/data/USER/a.json")
        self.assertTrue(result["doctor"]["devices"])
        self.assertEqual(result["doctor"]["devices"], as_ever["doctor"]["devices"])
        self.assertEqual([d["platforms"] for d in result["doctor"]["drivers"]], [d["platforms"] for d in as_ever["doctor"]["drivers"]])

    def test_without_a_run(self):
        result, text, _ = self.report("--no-run")
        self.assertIsNone(result["run"])
        self.assertIsNone(result["device"])
        self.impersonal(text)

    def test_nothing_else_of_the_environment_and_the_folder(self):
        """Variables with secrets have names similar to reported ones; the cache folder may contain other files."""
        os.makedirs(os.path.join(self.cache, "foreign"))
        for name in ("foreign/credentials.json", "credentials.json", "verdicts/credentials.txt", "credentials.bin"):
            self.keep(name, 'vsplat-kernel-2\n{"access_token": "hunter2"}' if name.endswith("bin") else '{"access_token": "hunter2"}')
        os.symlink("../credentials.json", os.path.join(self.cache, "verdicts", "link.json"))
        self.keep("verdicts/deep.json", "[" * 120000 + "]" * 120000)
        self.keep("verdicts/twice.json", '{"a": 1, "a": 2}')
        names = ("NVIDIA_API_KEY", "NEO4J_PASSWORD", "GPU_TOKEN", "VSPLAT_SECRET", "POCL_AUTH", "MESA_KEY", "HIP_PASS", "CUDA_CACHE_KEY")
        result, text, _ = self.report("--no-run", env={**{name: "hunter2" for name in names}, "CUDA_VISIBLE_DEVICES": "0"})
        self.assertNotIn("hunter2", text)
        self.assertEqual(result["environment"]["CUDA_VISIBLE_DEVICES"], "0")
        self.assertEqual([set(names) & set(result["environment"])], [set()])
        self.assertEqual({k["file"]: k.get("bytes") for k in result["kept"]}, {"verdicts/deep.json": 240000, "verdicts/twice.json": 16})

    def test_without_a_device(self):
        nowhere = os.path.join(self.home, "nowhere")
        result, text, err = self.report(env={"OCL_ICD_VENDORS": nowhere})
        self.assertIn("no device is opened", err)
        self.assertIsNone(result["run"])
        self.assertIn("OCL_ICD_VENDORS=~/nowhere is not there", result["doctor"]["findings"][0]["found"])
        self.impersonal(text)

    def test_a_driver_that_crashes_leaves_the_report(self):
        compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
        if not compiler:
            self.skipTest("no C compiler")
        library, vendors = self.path("libcrash.so"), self.path("vendors")
        subprocess.run([compiler, "-shared", "-fPIC", "-x", "c", "-", "-o", library], check=True, text=True,
                       input="#include <stdlib.h>\n__attribute__((constructor)) static void begin(void) { abort(); }\n")
        os.mkdir(vendors)
        pathlib.Path(os.path.join(vendors, "crash.icd")).write_text(library + "\n")
        result, _, _ = self.report(env={"OCL_ICD_VENDORS": vendors})
        self.assertEqual([d["state"] for d in result["doctor"]["drivers"]], ["crashed"])

    def test_nothing_is_written_over(self):
        pathlib.Path(self.path("report.json")).write_text("mine")
        self.refuses(1, "exists", "report", "--output", self.path("report.json"), env=self.env)


if __name__ == "__main__":
    support.main()
