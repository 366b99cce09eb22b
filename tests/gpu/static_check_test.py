"""static_check.py finds what it is there to find. Python's standard library and clang-15 alone."""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import static_check  # noqa: E402

CHECK = os.path.join(os.path.dirname(os.path.abspath(__file__)), "static_check.py")
# An array that is indexed at run time goes to scratch memory; in the other kernel nothing does.
SOURCE = """
kernel void sound(global float* x, int n) {
  float sum = 0.0f;
  for (int i = 0; i < n; ++i) sum = sum * x[i] + x[i + n];
  x[get_global_id(0)] = sum;
}
kernel void scratches(global float* x, global const int* at) {
  float kept[64];
  for (int i = 0; i < 64; ++i) kept[i] = x[i];
  for (int i = 0; i < 64; ++i) kept[at[i]] *= 2.0f;
  x[get_global_id(0)] = kept[at[64]];
}
kernel void large(global float* x, int at) {
  local float all[MANY];
  all[get_local_id(0)] = x[get_global_id(0)];
  barrier(CLK_LOCAL_MEM_FENCE);
  x[get_global_id(0)] = all[at];
}
"""


class Dump(unittest.TestCase):
    """A dump of the kernels above."""

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="vsplat-static-")
        self.addCleanup(shutil.rmtree, self.folder, True)
        pathlib.Path(self.path("a.cl")).write_text(SOURCE)

    def path(self, name):
        return os.path.join(self.folder, name)

    def check(self, kernels, *arguments, group=64, allowed="", options="-cl-std=CL1.2 -DMANY=64", target="nvptx:sm_80", **more):
        """-> exit code, stdout, stderr"""
        about = [{"name": k, "launches": [{"job": "render", "stage": "", "group": [group, 1, 1], "local_bytes": 0}]} for k in kernels]
        with open(self.path("kernels.json"), "w") as out:
            json.dump([{"name": "a", "source": "a.cl", "options": options, "kernels": kernels, "about": about, **more}], out)
        pathlib.Path(self.path("allowed.txt")).write_text(allowed)
        done = subprocess.run([sys.executable, CHECK, self.folder, "--targets", target, "--intel", "", *arguments], capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr


@unittest.skipUnless(shutil.which("clang-15") and os.path.exists("/usr/lib/clc/nvptx64--.bc"), "no clang-15 or libclc-15")
class StaticCheck(Dump):
    def test_what_is_sound_passes(self):
        code, out, err = self.check(["sound", "large"])
        self.assertEqual(code, 0, err)
        self.assertIn("sound", out)

    def test_scratch_is_found_and_excused_by_name(self):
        code, _, err = self.check(["sound", "scratches"])
        self.assertEqual(code, 1)
        self.assertIn("scratches", err)
        self.assertNotIn("sound", err)
        self.assertEqual(self.check(["sound", "scratches"], allowed="# why\nscratches nvptx: it is indexed\n")[0], 0)
        self.assertEqual(self.check(["sound", "scratches"], allowed="scratches amd: it is indexed\n")[0], 1)
        self.assertEqual(self.check(["sound", "scratches"], allowed="scratches nvptx:\n")[0], 1)  # no reason

    def test_what_does_not_compile_or_is_not_there(self):
        self.assertEqual(self.check(["sound"], options="-cl-std=CL1.2")[0], 1)
        self.assertEqual(self.check(["absent"])[0], 1)

    def test_a_program_is_for_its_vendors_or_chips(self):
        for targets, rows in ((["nvptx"], 1), (["amd", "nvptx:sm_80"], 1), (["nvptx:sm_90"], 0), (["amd:gfx90a"], 0)):
            _, out, err = self.check(["sound"], targets=targets)
            self.assertEqual(out.count("nvptx:sm_80"), rows, err)

    def test_groups_are_small(self):
        self.assertEqual(self.check(["sound"], group=257)[0], 1)

    def test_what_gets_worse_is_found(self):
        table = self.path("table.txt")
        self.assertEqual(self.check(["sound", "large"], "--table", table)[0], 0)
        self.assertEqual(self.check(["sound", "large"], "--baseline", table)[0], 0)
        self.assertIn("no longer", self.check(["sound"], "--baseline", table)[2])
        rows = open(table).read()
        share = next(line for line in rows.splitlines() if line.startswith("sound")).split()[-2]
        pathlib.Path(table).write_text(rows.replace(share, f"{float(share) + 0.1:.2f}"))
        code, _, err = self.check(["sound", "large"], "--baseline", table, "--anew")
        self.assertEqual(code, 1)
        self.assertIn("share of multiply-adds", err)
        pathlib.Path(table).write_text("")
        self.assertEqual(self.check(["sound", "large"], "--baseline", table)[0], 1)

    def test_what_the_table_was_made_of_is_not_compiled_again(self):
        table = self.path("table.txt")
        self.assertEqual(self.check(["sound", "large"], "--table", table)[0], 0)
        code, out, err = self.check(["sound", "large"], "--baseline", table, "--cache", self.path("cache"))
        self.assertEqual((code, out), (0, open(table).read()))
        self.assertIn("2 of them as", err)
        self.assertEqual(os.listdir(self.path("cache")), [])
        with open(self.path("a.cl"), "w") as changed:
            changed.write(SOURCE.replace("float sum = 0.0f;", "float sum = 0.0f, kept[64]; kept[n] = x[n]; sum += kept[n / 2];"))
        code, _, err = self.check(["sound", "large"], "--baseline", table, "--cache", self.path("cache"))
        self.assertEqual(code, 1)
        self.assertIn("sound", err)
        self.assertIn("0 of them as", err)
        self.assertEqual(len(os.listdir(self.path("cache"))), 1)

    def test_what_was_compiled_is_kept(self):
        self.assertEqual(self.check(["sound"], "--cache", self.path("cache"))[0], 0)
        kept = os.listdir(self.path("cache"))
        self.assertEqual(len(kept), 1)
        self.assertEqual(self.check(["sound"], "--cache", self.path("cache"))[0], 0)
        self.assertEqual(os.listdir(self.path("cache")), kept)
        self.assertEqual(self.check(["sound"], "--cache", self.path("cache"), options="-cl-std=CL1.2 -DMANY=65")[0], 0)
        self.assertEqual(len(os.listdir(self.path("cache"))), 2)


@unittest.skipUnless(static_check.PTXAS, "no ptxas")
class Assembler(Dump):
    def test_nvidias_assembler(self):
        for chip in ("sm_75", "sm_80", "sm_90", "sm_120"):
            code, out, err = self.check(["sound", "large"], target=f"nvidia:{chip}")
            self.assertEqual(code, 0, err)
            registers, spill, scratch, local, warps = next(line for line in out.splitlines() if line.startswith("large"))[86:].split()[:5]
            self.assertEqual((spill, scratch, local, int(warps)), ("0", "0", "256", static_check.WARPS[chip]))
            self.assertGreater(int(registers), 4)
            code, _, err = self.check(["scratches"], target=f"nvidia:{chip}")
            self.assertEqual(code, 1)
            self.assertIn(f"scratches -DMANY=64 on nvidia:{chip}: 0 bytes spilled, 256 of scratch", err)
        # It holds a table: fewer warps are a problem. Without the assembler, what is not in the table is left out.
        table = self.path("table.txt")
        self.assertEqual(self.check(["sound", "large"], "--table", table, target="nvidia:sm_90")[0], 0)
        self.assertEqual(self.check(["sound", "large"], "--baseline", table, "--ptxas", "", target="nvidia:sm_90")[:2], (0, pathlib.Path(table).read_text()))
        with open(self.path("a.cl"), "a") as changed:
            changed.write("kernel void more(global float* x) { x[0] = 1.0f; }\n")
        code, _, err = self.check(["sound", "large", "more"], "--baseline", table, "--ptxas", "", target="nvidia:sm_90,nvptx:sm_80")
        self.assertEqual(code, 0, err)
        self.assertIn("there is no ptxas: 3 kernels", err)


if __name__ == "__main__":
    unittest.main()
