"""vsplat selftest: a sound device passes, kernels that are made wrong on purpose are found, and what is switched off is not used."""
import glob
import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import time

import support
from tune_test import tables, with_choice

CL = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "cl")


class SelftestCase(support.Case):
    def setUp(self):
        super().setUp()
        self.cache = self.path("cache")
        self.env = {"VSPLAT_CACHE_DIR": self.cache, "VSPLAT_TUNING": "", "VSPLAT_SELFTEST": ""}

    def plant(self, *faults):
        """Writes the kernels to a folder, with the text of a file changed for each fault. Returns the environment for a command that uses them."""
        folder = self.path("kernels")
        shutil.copytree(CL, folder)
        for file, before, after in faults:
            [path] = glob.glob(os.path.join(folder, "**", file), recursive=True)
            text = pathlib.Path(path).read_text()
            self.assertEqual(text.count(before), 1, f"{file}: {before}")
            pathlib.Path(path).write_text(text.replace(before, after))
        return {**self.env, "VSPLAT_KERNEL_DIR": folder}

    def selftest(self, code, env, *more):
        got, out, err = support.run("selftest", "--quick", "--json", *more, env=env)
        self.assertEqual(got, code, err)
        return json.loads(out), err

    def numbers(self, path):
        """Returns the number of bytes of a binary PLY."""
        data = pathlib.Path(path).read_bytes()
        body = data[data.index(b"end_header\n") + 11:]
        return struct.unpack(f"<{len(body) // 4}f", body[:len(body) // 4 * 4])

    def journals(self):
        return [f for _, _, files in os.walk(os.path.join(self.cache, "selftests")) for f in files]

    def scene(self, model, name, env, *more):
        """Returns the scene's numbers and the messages."""
        output = self.path(name + ".ply")
        _, err = self.succeeds("reconstruct", self.views, "--model", model, "--output", output, *more, env=env)
        return self.numbers(output), err

    def difference(self, a, b):
        return max(abs(x - y) for x, y in zip(a, b)) / max(abs(x) for x in a) if len(a) == len(b) else float("inf")

    def wrong(self, report, flavour):
        return {k["kernel"] for f in report["flavours"] if f["flavour"] == flavour for k in f["kernels"] if k["verdict"] == "wrong"}

    def unusable(self):
        """Returns the environment of kernels with one irreplaceable fault, which a self-test has found."""
        env = self.plant(("decode.cl", "  decode(raw + (long)k * (8 + D + sh_size), (voxel + 0.5f) /",
                          "  decode(raw + (long)k * (8 + D + sh_size), (voxel + 0.501f) /"))
        report, err = self.selftest(1, env)
        self.assertEqual((report["verdict"], report["off"], report["remembered"]), ("unusable", ["cpu", "gpu"], "now"))
        self.assertEqual(self.wrong(report, "cpu"), {"decode_coarse_forward"})
        self.assertEqual(self.wrong(report, "gpu"), {"decode_coarse_forward"})
        self.assertIn("another device or another driver", err)
        words = ["decode_coarse_forward", "computes wrongly", "with driver", "allowed", "another driver", "VSPLAT_SELFTEST=ignore"]
        self.refuses(1, words, *self.reconstruct(), env=env)
        return env


class Selftest(SelftestCase):
    def test_a_sound_device(self):
        report, err = self.selftest(0, self.env)
        self.assertEqual((report["verdict"], report["off"], report["worst"], report["remembered"]), ("ok", [], "", "now"))
        self.assertTrue(report["quick"])
        self.succeeds("init", "micro", "--system", "lara", "--seed", 1, "--output", self.path("lara.safetensors"))
        for flavour in report["flavours"]:
            self.assertEqual(flavour["wrong"], [])
            tested = {(k["file"], k["kernel"]) for k in flavour["kernels"]}
            for kernel in flavour["kernels"]:
                self.assertEqual(kernel["verdict"], "ok", kernel)
                self.assertGreater(kernel["results"], 0)
                self.assertLessEqual(kernel["error"], kernel["tolerance"], kernel)
            # Every kernel that a job launches in this flavour has been tested in it.
            for model in (self.model, self.path("lara.safetensors")):
                listed = json.loads(self.succeeds("kernels", "--model", model, "--no-build", "--json", "--flavour", flavour["flavour"])[0])
                launched = {(p["name"], k["name"]) for p in listed for k in p["about"] if k["launches"]}
                self.assertGreater(len(launched), 80)
                self.assertEqual(launched - tested, set(), flavour["flavour"])
        self.assertNotIn("self-test", self.scene(self.model, "sound", self.env)[1])

    def test_a_wrong_variant_and_a_wrong_flavour_are_switched_off(self):
        """A fault in a method of one flavour, and another in the other flavour: one self-test distinguishes them."""
        wide = self.path("wide.safetensors")  # as many channels as Winograd's method needs
        self.succeeds("init", "micro", "--seed", 3, "--set", "volume_ch=32", "--output", wide)
        cpu = ("--kernels", "cpu")
        sound_wide, _ = self.scene(wide, "sound-wide", self.env, *cpu)
        sound, _ = self.scene(self.model, "sound", self.env, *cpu)
        env = self.plant(("conv3d_winograd.cl", "      TILE_STORE(products + (p * 36 + i) * 2 * TILE_ROWS)\n",
                          "      TILE_STORE(products + (p * 36 + i) * 2 * TILE_ROWS)\n      if (i == 7) products[(p * 36 + i) * 2 * TILE_ROWS] += 0.5f;\n"),
                         ("gemm_gpu.cl", "if (k0 + dk < K && n0 + dn < width)\n", "if (k0 + dk < K && n0 + dn < width && n0 + dn != 17)\n"))
        self.assertGreater(self.difference(sound_wide, self.scene(wide, "before", env, *cpu)[0]), 1e-4, "the fault does nothing")
        report, _ = self.selftest(0, env)
        self.assertEqual((report["verdict"], set(report["off"])), ("degraded", {"winograd", "gpu"}))
        self.assertEqual(self.wrong(report, "cpu"), {"winograd_forward_pack", "winograd_forward_tile"})  # both contribute to one result
        # The kernel with the fault packs weights on the device, so the kernels that multiply by them are wrong, too.
        self.assertEqual(self.wrong(report, "gpu"), {"gemm_pack_plain", "gemm_tile_gpu", "gemm_matrix_gpu"})
        self.assertEqual([f["usable"] for f in report["flavours"]], [True, False])
        # Listing devices reports it as well.
        listed = json.loads(self.succeeds("devices", "--json", env=env)[0])
        self.assertIn((report["device"], "degraded"), [(d["name"], d["fitness"]) for d in listed])
        self.assertIn("[its self-test: degraded]", self.succeeds("devices", env=env)[0])
        self.assertEqual({d["fitness"] for d in json.loads(self.succeeds("devices", "--json", env=self.env)[0])}, {None}, "of the library's own kernels")
        [found] = [f for f in json.loads(support.run("doctor", "--json", env=env)[1])["findings"] if f["kind"] == "device_degraded"]
        for words in (report["device"], "gpu kernels", report["worst"], report["date"]):
            self.assertIn(words, found["found"])
        self.assertIn("kernel winograd_forward_", report["worst"])
        # Without Winograd's method.
        now, err = self.scene(wide, "after", env, *cpu)
        self.assertRegex(err.splitlines()[0], "not used since its self-test: .*Winograd's convolutions")
        self.assertLess(self.difference(sound_wide, now), 1e-4)
        # Without the gpu flavour, even where it is the device's own.
        now, err = self.scene(self.model, "narrow", {**env, "VSPLAT_KERNELS": ""})
        self.assertRegex(err.splitlines()[0], "cpu kernels, not used since its self-test: .*gpu kernels")
        self.assertEqual(now, sound, "not the cpu kernels' scene")
        self.refuses(1, ["gpu kernels were asked for by name", "self-test", "VSPLAT_SELFTEST=ignore"], *self.reconstruct("--kernels", "gpu"), env=env)
        self.assertIn("gpu kernels", self.scene(self.model, "all the same", {**env, "VSPLAT_SELFTEST": "ignore"}, "--kernels", "gpu")[1])
        # The verdict applies to those kernels; the library's own are not affected.
        self.assertNotIn("self-test", self.scene(wide, "others", self.env, *cpu)[1])

    def test_a_driver_that_crashes_does_not_end_it(self):
        """A kernel of one method ends the process; another breaks all products of a flavour."""
        crash = "*(volatile global int*)16 = 0;"
        env = self.plant(("conv3d_winograd.cl", "      TILE_STORE(products + (p * 36 + i) * 2 * TILE_ROWS)\n",
                          "      TILE_STORE(products + (p * 36 + i) * 2 * TILE_ROWS)\n      if (i == 7) " + crash + "\n"),
                         ("gemm_gpu.cl", "if (k0 + dk < K && n0 + dn < width)\n", "if (n0 + dn == 17) " + crash + "\n      if (k0 + dk < K && n0 + dn < width)\n"))
        report, err = self.selftest(0, env)
        self.assertEqual((report["verdict"], set(report["off"]), report["remembered"]), ("degraded", {"winograd", "gpu"}, "now"))
        self.assertIn("Segmentation fault", report["worst"])
        self.assertIn("kernel compiled last was ", report["worst"])
        self.assertIn("its process was ended (signal 11, Segmentation fault)", err)
        cpu, gpu = report["flavours"]
        self.assertEqual([cpu["usable"], gpu["usable"]], [True, False])
        self.assertEqual({w["what"] for w in cpu["wrong"]}, {"conv3d_winograd", "conv3d_pairs"})
        self.assertEqual(len(gpu["wrong"]), 4, "it is given up there")
        self.assertEqual(self.journals(), [])
        now, err = self.scene(self.model, "after", {**env, "VSPLAT_KERNELS": ""})
        self.assertRegex(err.splitlines()[0], "not used since its self-test: .*gpu kernels.*Winograd's convolutions")
        self.assertEqual(now, self.scene(self.model, "sound", self.env, "--kernels", "cpu")[0])

    def test_a_process_that_is_killed_tells_nothing_of_the_device(self):
        """As if memory were short."""
        started = subprocess.Popen([support.VSPLAT, "selftest", "--quick"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **self.env})
        while started.poll() is None and not self.journals():
            time.sleep(0.01)
        with open(f"/proc/{started.pid}/task/{started.pid}/children") as f:
            os.kill(int(f.read().split()[0]), signal.SIGKILL)
        out, err = started.communicate(timeout=support.PATIENCE)
        self.assertEqual((started.returncode, out), (1, ""), err)
        self.assertIn("ended from outside (signal 9, Killed)", err)
        self.assertFalse(os.path.exists(os.path.join(self.cache, "verdicts")))

    @support.slow
    def test_a_driver_that_hangs_is_ended(self):
        env = self.plant(("rope.cl", "  turn_pair(dqkv,", "  for (volatile int on = 1; on;) {}\n  turn_pair(dqkv,"))
        report, err = self.selftest(1, env, "--patience", 15)
        self.assertEqual((report["verdict"], report["off"], report["remembered"]), ("unusable", ["cpu", "gpu"], "now"))
        self.assertIn("rope", report["worst"])
        self.assertIn("nothing was heard of it any more", report["worst"])
        self.assertLess(err.count("its process was ended"), 10, "once in each flavour, and without each thing that could be left out")

    @support.slow
    def test_a_wrong_tuned_variant_is_taken_out_of_the_table(self):
        """Half of the products are wrong in every loop of one unrolling, which a table chose when it was right. In the quick tests:
        SelftestErrors.ATableIsTriedWithItsOwnFlavour."""
        gpu = ("--kernels", "gpu")
        sound, _ = self.scene(self.model, "sound", self.env, *gpu)
        loop = "  TILE_UNROLL\n  for (int s = 0; s < BK; ++s) {\n"
        env = self.plant(("tile_gpu.clh", loop, "#if defined(UNROLL) && UNROLL == 2\n  for (int s = 0; s < BK / 8; ++s) {\n#else\n" + loop + "#endif\n"))
        # A table without findings so far, with the network's shapes: a search would take too long on a slow machine.
        result = json.loads(self.succeeds("tune", "--model", self.model, "--for", "reconstruct", "--seconds", 1e-9, "--json", *gpu, env=env)[0])
        shape = next(one["shape"] for one in result["shapes"] if one["op"] == "conv3d")
        [path] = tables(self.cache)
        table = json.loads(pathlib.Path(path).read_text())
        wrong = {"op": "conv3d", "shape": shape, "set": {"tile": 64, "unroll": 2}}
        pathlib.Path(path).write_text(json.dumps(with_choice(table, wrong)))
        before, err = self.scene(self.model, "before", env, *gpu)
        self.assertIn("tuned (table", err)
        self.assertGreater(self.difference(sound, before), 1e-4, "the fault does nothing")
        report, _ = self.selftest(0, env)
        self.assertEqual((report["verdict"], report["off"]), ("degraded", ["tuned"]))
        self.assertIn("unroll=2", report["worst"])
        self.assertEqual([(one["right"], one["error"] is None or one["error"] > 1) for f in report["flavours"] for one in f["tuned"]], [(False, True)])
        self.assertEqual(self.wrong(report, "gpu"), set())
        now, err = self.scene(self.model, "after", env, *gpu)
        self.assertIn("not used since its self-test: tuned parameters that are wrong", err.splitlines()[0])
        self.assertNotIn("tuned (table", err.splitlines()[0])
        self.assertLess(self.difference(sound, now), 1e-4)

    @support.slow
    def test_a_wrong_kernel_that_nothing_replaces(self):
        """In the quick tests: VerdictTest.AnUnusableDeviceIsRefusedButWhereItIsIgnored."""
        env = self.unusable()
        self.assertNotIn("self-test", self.scene(self.model, "ignored", {**env, "VSPLAT_SELFTEST": "ignore"})[1])
        # A repaired kernel is a different kernel.
        self.scene(self.model, "sound", self.env)

    @support.slow
    def test_kernels_at_hand_leave_nothing_behind(self):
        """Without a cache. In the quick tests, with a cache: VerdictTest."""
        folder = self.path("kernels")
        shutil.copytree(CL, folder)
        home = self.path("home")
        os.makedirs(home)
        env = {"VSPLAT_KERNEL_DIR": folder, "VSPLAT_CACHE_DIR": "", "HOME": home, "VSPLAT_SELFTEST": ""}
        if "POCL_CACHE_DIR" not in os.environ and "XDG_CACHE_HOME" not in os.environ:
            env["POCL_CACHE_DIR"] = os.path.join(os.path.expanduser("~"), ".cache", "pocl", "kcache")
        report, err = self.selftest(0, env)
        self.assertEqual((report["verdict"], report["remembered"]), ("ok", "no"))
        self.assertIn("verdict is not stored", err)

    def test_asks_for_what_there_is(self):
        self.refuses(1, ["no device is", "--device"], "selftest", "--device", "nowhere")
        self.refuses(2, "--what", "selftest", "--what")

    @support.slow
    def test_what_is_refused_is_tested_again(self):
        """In the quick tests: VerdictTest.WhoTestsADeviceOpensItAllTheSame."""
        env = self.unusable()
        self.assertEqual(self.selftest(1, env)[0]["remembered"], "now")
        self.refuses(1, "computes wrongly", *self.reconstruct(), env=env)


if __name__ == "__main__":
    support.main()
