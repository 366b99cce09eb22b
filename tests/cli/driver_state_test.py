"""Unusual states of a driver: damaged compiled kernels of PoCL, a signal during compilation, invalid environment variables. None of them
ends in a compile error of a kernel, or in a crash. Uses only Python's standard library."""
import json
import os
import shutil
import signal
import subprocess
import time

import support

POCL = "Portable Computing Language"


def has_pocl():
    _, out, _ = support.run("devices", "--json")
    return any(device["platform_name"] == POCL for device in json.loads(out or "[]"))


class Pocl(support.FolderCase):
    """Each test has its own folder of compiled kernels."""
    @classmethod
    def setUpClass(cls):
        if not has_pocl():
            raise support.unittest.SkipTest("there is no PoCL")

    def setUp(self):
        super().setUp()
        support.write_scene(self.path("scene.ply"), [((0.1 * i - 0.3, 0, 0), (i / 6, 1, 0), 0.08, 0.8) for i in range(7)])
        only = "/etc/OpenCL/vendors/pocl.icd"  # the other drivers are not loaded
        self.env = {**({"OCL_ICD_VENDORS": only} if os.path.exists(only) else {}), "POCL_CACHE_DIR": self.path("kernels"), "VSPLAT_CACHE_DIR": self.path("own"), "POCL_KERNEL_CACHE": "1", "VSPLAT_DEVICE": "Portable"}

    def draws(self):
        return ("render", self.path("scene.ply"), "--cameras", "orbit:1", "--up", "0,1,0", "--size", "16x16", "--images", self.path("out"), "--overwrite", "--quiet")

    def files(self, ending):
        return sorted(os.path.join(root, name) for root, _, names in os.walk(self.path("kernels")) for name in names if name.endswith(ending))

    def drawn(self):
        """Returns the picture and the messages."""
        code, _, err = support.run(*self.draws(), env=self.env)
        self.assertEqual(code, 0, err)
        with open(self.path("out", "0000.png"), "rb") as f:
            return f.read(), err

    def test_damaged_kernels_are_found_reported_and_made_anew(self):
        whole, err = self.drawn()
        self.assertEqual(err, "")
        self.assertEqual(self.doctor(), [], "nothing is wrong with what PoCL has just written")
        shutil.copytree(self.path("kernels"), self.path("kept"))
        sizes = {ending: os.path.getsize(self.files(ending)[0]) for ending in (".so", ".bc")}
        self.assertTrue(all(size > 4096 for size in sizes.values()))
        damages = {}
        for name, ending, content in (("empty", ".so", lambda old: b""), ("half", ".so", lambda old: old[:len(old) // 2]),
                                      ("garbage", ".so", lambda old: bytes((i * 7919 + i // 256) % 251 for i in range(len(old)))),
                                      ("empty", ".bc", lambda old: b""), ("but the end", ".bc", lambda old: old[:-100]),
                                      ("text", ".bc", lambda old: b"<html>" * 1000)):
            damages[ending, name] = content
        for (ending, name), content in damages.items():
            with self.subTest(ending=ending, damage=name):
                shutil.rmtree(self.path("kernels"))
                shutil.copytree(self.path("kept"), self.path("kernels"))
                damaged = self.files(ending)[0]
                with open(damaged, "rb") as f:
                    old = f.read()
                with open(damaged, "wb") as f:
                    f.write(content(old))
                (found,) = self.doctor()
                self.assertEqual(found["about"], damaged)
                self.assertIn("rm -r", found["mend"])
                picture, err = self.drawn()
                self.assertEqual(picture, whole)
                self.assertIn(damaged, err)
                self.assertIn("removed, it is compiled again", err)
                self.assertEqual((self.drawn(), self.doctor()), ((whole, ""), []))

    def test_several_and_what_is_no_file(self):
        whole, _ = self.drawn()
        first, second = self.files(".so")[:2]
        os.truncate(first, 100)
        os.remove(second)
        os.mkdir(second)
        self.assertEqual(len(self.doctor()), 2)
        picture, err = self.drawn()
        self.assertEqual(picture, whole)
        self.assertIn("and 1 more were", err)

    def test_what_another_process_is_writing_stays(self):
        """PoCL links into a file beside the folders of programs and moves it there: until then it may be empty for long."""
        self.drawn()
        for name in ("tempfile_a1B2c3.so", "tempfile_d4E5f6.bc"):
            with open(self.path("kernels", name), "wb"):
                pass
        self.assertEqual(self.doctor(), [])
        self.assertEqual(self.drawn()[1], "")
        for name in ("tempfile_a1B2c3.so", "tempfile_d4E5f6.bc"):
            self.assertTrue(os.path.exists(self.path("kernels", name)), name)

    def test_damage_that_is_not_seen_is_reported_when_it_crashes(self):
        """Overwritten code shows no damage before it runs."""
        self.drawn()
        for path in self.files(".so"):
            with open(path, "r+b") as f:
                f.seek(4096)
                f.write(b"\x0f\x0b" * 500)  # invalid instructions on every processor
        self.assertEqual(self.doctor(), [])
        code, _, err = support.run(*self.draws(), env=self.env)
        self.assertLess(code, 0, err)
        self.assertIn(f"rm -r {self.path('kernels')}", err)

    def doctor(self):
        _, out, _ = support.run("doctor", "--json", env=self.env)
        return [finding for finding in json.loads(out)["findings"] if finding["kind"] == "damaged_kernel"]

    def started(self, **options):
        shutil.rmtree(self.path("kernels"), True)
        process = subprocess.Popen([support.VSPLAT, *self.draws()], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                   env={**os.environ, **self.env}, **options)
        while not os.path.isdir(self.path("kernels")) and process.poll() is None:
            time.sleep(0.01)
        return process

    def test_an_ignored_hangup_stays_ignored_while_compiling(self):
        process = self.started(preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        sent = 0
        while process.poll() is None:
            process.send_signal(signal.SIGHUP)
            sent += 1
            time.sleep(0.02)
        self.assertGreater(sent, 10)
        self.assertEqual((process.returncode, process.stderr.read()), (0, ""))
        process.stderr.close()

    def test_a_signal_while_compiling_stops_it_with_one_line(self):
        for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)):
            process = self.started(start_new_session=True)
            time.sleep(0.3)
            os.killpg(process.pid, number)  # as a terminal does: programs that the driver has started get it, too
            _, err = process.communicate(timeout=support.PATIENCE)
            self.assertEqual(process.returncode, code, err)
            self.assertNotIn("compile", err)
            self.assertEqual(len(err.splitlines()), 1, err)
            self.drawn()

    def test_a_second_signal_ends_it_at_once(self):
        process = self.started()
        while process.poll() is None:  # two signals at the same time may count as one
            process.send_signal(signal.SIGTERM)
            time.sleep(0.05)
        process.communicate()
        self.assertIn(process.returncode, (-signal.SIGTERM, 128 + signal.SIGTERM))  # the first may have been enough


    def test_no_space_for_kernels(self):
        """Told as what it is, before PoCL calls it a failed compilation."""
        self.env["POCL_CACHE_DIR"] = self.path("narrow", "kernels")
        os.mkdir(self.path("narrow"))
        limit = ("sh", "-c", "ulimit -f 100; exec \"$@\"", "sh", support.VSPLAT, *self.draws())
        done = subprocess.run(limit, capture_output=True, text=True, env={**os.environ, **self.env}, check=False)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(self.path("narrow", "kernels") + ": File too large", done.stderr)
        self.assertIn("set POCL_CACHE_DIR", done.stderr)

    def test_flags_that_do_not_compile_are_named(self):
        code, _, err = support.run(*self.draws(), env={**self.env, "POCL_EXTRA_BUILD_FLAGS": "-no-such-flag"})
        self.assertEqual(code, 1, err)
        self.assertIn("and POCL_EXTRA_BUILD_FLAGS=-no-such-flag", err)

    def test_no_devices_by_a_variable(self):
        code, _, err = support.run(*self.draws(), env={**self.env, "POCL_DEVICES": "none\u202e"})
        self.assertEqual(code, 1, err)
        self.assertIn("POCL_DEVICES is \"none", err)
        self.assertNotIn("\u202e", err)

    def test_an_empty_cache_folder_is_none(self):
        code, _, err = support.run(*self.draws(), env={**self.env, "POCL_CACHE_DIR": "", "XDG_CACHE_HOME": self.path("cache")})
        self.assertEqual(code, 0, err)
        self.assertTrue(os.path.isdir(self.path("cache", "pocl")))


class Environment(support.FolderCase):
    def test_what_is_not_understood_is_refused_by_name(self):
        for name, value in (("VSPLAT_KERNELS", "fast"), ("VSPLAT_SELFTEST", "no"), ("VSPLAT_CHECK", "nans"), ("VSPLAT_ARENA", "1"),
                            ("VSPLAT_MATRIX_LEAST", "many"), ("VSPLAT_MATRIX_LEAST", "-3"), ("PMI_SIZE", "two"), ("OMPI_COMM_WORLD_SIZE", "2 "),
                            ("POCL_MAX_PTHREAD_COUNT", "-1"), ("POCL_MAX_WORK_GROUP_SIZE", "x"), ("POCL_WORK_GROUP_METHOD", "fast"),
                            ("VSPLAT_LIMITS", "group=lots"), ("VSPLAT_DEVICE", "no such device \u202e")):
            with self.subTest(name=name, value=value):
                code, _, err = support.run("init", "micro", "--seed", 1, "--output", self.path("m.safetensors"), "--overwrite")
                self.assertEqual(code, 0, err)
                code, out, err = support.run("weights", "check", self.path("m.safetensors"), env={name: value})
                self.assertIn(code, (1, 2), err)
                self.assertIn(name, err)
                self.assertNotIn("\u202e", err)
                self.assertEqual(out, "")

    def test_home_is_absolute(self):
        unset = {"XDG_CACHE_HOME": "", "VSPLAT_CACHE_DIR": "", "POCL_CACHE_DIR": ""}
        for name, env in (("HOME", {**unset, "HOME": "here"}), ("XDG_CACHE_HOME", {**unset, "XDG_CACHE_HOME": "./here"})):
            folder = self.path(name)
            os.mkdir(folder)
            code, _, err = support.run("devices", env=env, cwd=folder)
            self.assertEqual(code, 2, err)
            self.assertIn(f'{name} is "{env[name]}", an absolute path expected', err)
            self.assertEqual(os.listdir(folder), [])
            code, out, _ = support.run("doctor", "--json", env=env, cwd=folder)
            self.assertEqual([f["about"] for f in json.loads(out)["findings"] if f["kind"] == "variable"], [name])
        # If nothing is cached below it, it does not matter.
        env = {"XDG_CACHE_HOME": "", "HOME": "here", "VSPLAT_CACHE_DIR": self.path("own"), "POCL_CACHE_DIR": self.path("kernels")}
        self.assertEqual(support.run("devices", env=env, cwd=self.folder)[0], 0)


if __name__ == "__main__":
    support.main()
