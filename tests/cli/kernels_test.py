"""vsplat kernels: lists every kernel of cl/ with its build options; every dumped program compiles by itself."""
import glob
import json
import os
import re
import shutil
import subprocess

import support

CL = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "cl")


def kernels_of(flavour):
    """Returns {(file, kernel)} from the sources' text alone."""
    other = {"gpu": "_cpu", "cpu": "_gpu"}[flavour]
    out = set()
    for path in sorted(glob.glob(os.path.join(CL, "**", "*.cl"), recursive=True)):
        name, text = os.path.basename(path)[:-3], open(path).read()
        cpu_alone = re.search(r"^// flavour: cpu$", text, re.M)
        text = re.sub(r"//.*", "", text)
        for kernel in re.findall(r"\bkernel\b[^;{}]*?\bvoid\s+(?:[A-Z_]+\s+)*(\w+)\s*\(", text):
            said = next((end for end in ("_cpu", "_gpu") if kernel.endswith(end)), None) or name[-4:]
            if said != other and not (flavour == "gpu" and cpu_alone):
                out.add((name, kernel))
    return out


class Kernels(support.Case):
    def listed(self, *arguments):
        return json.loads(self.succeeds("kernels", "--model", self.model, "--no-build", "--json", *arguments)[0])

    def test_every_kernel_is_listed(self):
        for flavour in ("gpu", "cpu"):
            wanted = kernels_of(flavour)
            self.assertGreater(len(wanted), 100)
            found = {(p["name"], k) for p in self.listed("--flavour", flavour) for k in p["kernels"]}
            self.assertEqual(wanted - found, set(), flavour)

    def test_who_launches_it(self):
        programs = self.listed()
        gemm = [k for p in programs if p["name"] == "gemm_gpu" for k in p["about"] if k["name"] == "gemm_tile_gpu"]
        launches = [launch for k in gemm for launch in k["launches"]]
        self.assertEqual({launch["job"] for launch in launches}, {"reconstruct", "train"})
        self.assertIn("volume", {launch["stage"] for k in programs for a in k["about"] for launch in a["launches"]})
        self.assertEqual({tuple(launch["group"]) for launch in launches}, {(256, 1, 1)})
        drawn = {k["name"]: {launch["job"] for launch in k["launches"]} for p in self.listed("--for", "render") for k in p["about"]}
        self.assertEqual(drawn["rasterize_forward_gpu"], {"render"})
        self.assertEqual(drawn["gemm_tile_gpu"], set())
        # The kernels of the other networks, by their jobs.
        self.succeeds("init", "micro", "--system", "lara", "--seed", 1, "--output", self.path("lara.safetensors"))
        lara = json.loads(self.succeeds("kernels", "--model", self.path("lara.safetensors"), "--no-build", "--json")[0])
        jobs = {k["name"]: {launch["job"] for launch in k["launches"]} for p in lara for k in p["about"]}
        self.assertEqual(jobs["rasterize_surfels_backward_gpu"], {"render", "train"})

    def test_what_really_runs_is_in_the_list(self):
        """Compared with profiles of runs: every kernel in them is listed for that job."""
        def names(job, flavour, profile):
            listed = {}
            for k in (k for p in self.listed("--flavour", flavour) for k in p["about"]):
                listed.setdefault(k["name"], set()).update(launch["job"] for launch in k["launches"])
            run = [k["kernel"] if "kernel" in k else k["name"] for k in json.load(open(profile))["kernels"]]
            return {name for name in run if name in listed and job not in listed[name]}
        for flavour in ("gpu", "cpu"):
            self.succeeds(*self.reconstruct("--kernels", flavour, "--gemm", "own", "--profile", self.path("r.json"), "--overwrite"))
            self.assertEqual(names("reconstruct", flavour, self.path("r.json")), set())
        self.succeeds("render", self.path("out.ply"), "--cameras", "orbit:1", "--images", self.path("pictures"), "--size", "32x32", "--kernels", "gpu",
                      "--profile", self.path("d.json"))
        self.assertEqual(names("render", "gpu", self.path("d.json")), set())

    def test_local_memory_is_the_compilers(self):
        out = json.loads(self.succeeds("kernels", "--for", "render", "--json")[0])
        about = {k["name"]: k for p in out for k in p["about"]}
        records = 256 * 12 * 4  # of a group's Gaussians, plus a word or two
        driver = json.loads(self.succeeds("devices", "--json")[0])[0]["driver"]
        if not driver.startswith(("5.0", "6.0")):  # PoCL 5.0 and 6.0 report 0 for every kernel
            self.assertIn(about["rasterize_forward_gpu"]["local_memory"], range(records, records + 256))
        self.assertEqual([k["error"] for k in about.values() if "error" in k], [])

    def test_the_dump_is_all_that_it_takes(self):
        self.succeeds("kernels", "--model", self.model, "--flavour", "all", "--no-build", "--dump", self.path("dump"))
        programs = json.load(open(self.path("dump", "kernels.json")))
        self.assertEqual({p["flavour"] for p in programs}, {"gpu", "cpu"})
        compiler = next(filter(None, map(shutil.which, ("clang", "clang-15", "clang-14"))), None)
        for program in programs:
            text = open(self.path("dump", program["source"])).read()
            self.assertNotIn("#include", text)
            for kernel in program["kernels"]:
                self.assertRegex(text, rf"void\s+{kernel}\(")
        for name in os.listdir(self.path("dump")):
            self.assertIn(name, {p["source"] for p in programs} | {"kernels.json", "about.txt", "allowed.txt"})
        if not compiler:
            self.skipTest("no clang")
        for program in programs:
            if "targets" in program:  # only one vendor's compilers can read it
                continue
            with self.subTest(program=program["name"], options=program["options"]):
                done = subprocess.run([compiler, "-x", "cl", *program["options"].split(), "-fsyntax-only", "-Xclang", "-finclude-default-header",
                                       "-target", "spir64", self.path("dump", program["source"])], capture_output=True, text=True, cwd="/")
                self.assertEqual(done.returncode, 0, done.stderr)

    def test_matrix_units(self):
        """Their programs are for the compilers that can read them; in mixed precision the network's products are the emulated ones here."""
        targets = {p["name"]: p.get("targets") for p in self.listed("--for", "render")}
        self.assertEqual({name: of for name, of in targets.items() if of},
                         {"gemm_matrix_ptx_gpu": ["nvptx"], "gemm_matrix_dpas_gpu": ["intel:dg2", "intel:pvc"],
                          "gemm_matrix_wmma_gpu": ["amd:gfx1100"], "gemm_matrix_mfma_gpu": ["amd:gfx90a"]})
        env = {"VSPLAT_MATRIX": "emulated", "VSPLAT_MATRIX_LEAST": "1"}
        mixed = self.succeeds("kernels", "--model", self.model, "--no-build", "--json", "--for", "reconstruct,train", "--precision", "mixed", env=env)[0]
        launched = {k["name"]: {launch["job"] for launch in k["launches"]} for p in json.loads(mixed) for k in p["about"] if k["launches"]}
        self.assertEqual(set.union(*launched.values()), {"reconstruct"})  # mixed precision has no training
        self.assertIn("gemm_matrix_gpu", launched)
        self.assertNotIn("gemm_tile_gpu", launched)

    def test_what_is_wrong_is_refused(self):
        self.refuses(2, ["--for", "dance"], "kernels", "--for", "render,dance")
        self.refuses(2, "--flavour", "kernels", "--kernels", "gpu")
        self.refuses(2, "--flavour", "kernels", "--flavour", "dsp")
        os.mkdir(self.path("dump"))
        open(self.path("dump", "gemm_gpu.cl"), "w").write("mine\n")
        self.refuses(1, "gemm_gpu.cl", "kernels", "--for", "render", "--no-build", "--dump", self.path("dump"))
        self.refuses(1, "nothing.safetensors", "kernels", "--model", self.path("nothing.safetensors"))


if __name__ == "__main__":
    support.main()
