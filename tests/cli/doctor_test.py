"""vsplat doctor: names what keeps devices away, with a remedy, and still examines what is intact beside it."""
import glob
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time

import support

COMPILER = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc") or shutil.which("clang")
USUAL = "/etc/OpenCL/vendors"


def state_of(process):
    """Returns the process's state (X: it does not exist) and its parent."""
    try:
        with open(f"/proc/{process}/stat") as f:
            return f.read().rsplit(")", 1)[1].split()[:2]
    except OSError:
        return "X", "0"


def children_of(process):
    return [p for p in os.listdir("/proc") if p.isdigit() and state_of(p)[1] == str(process)]


class Doctor(support.FolderCase):
    def setUp(self):
        super().setUp()
        os.mkdir(self.path("vendors"))

    def doctor(self, *more, **env):
        """Returns exit code, JSON, and the text output; both come from separate runs, which agree."""
        env = {"OCL_ICD_VENDORS": self.path("vendors"), "OCL_ICD_FILENAMES": "", "VSPLAT_DEVICE": "", **env}
        code, out, err = support.run("doctor", "--json", *more, env=env)
        result = json.loads(out)
        again, text, _ = support.run("doctor", *more, env=env)
        self.assertEqual(again, code)
        self.assertEqual(code, 1 if result["findings"] else 0, err)
        if result["findings"]:
            self.assertRegex(err, r"\d+ things? (is|are) wrong")
        for finding in result["findings"]:
            self.assertIn(finding["found"], text)
            self.assertIn(finding["mend"], text)
            self.assertTrue(finding["mend"] and finding["about"])
        return code, result, text

    def wait_until(self, done, seconds=60):
        until = time.time() + seconds
        while not done():
            self.assertLess(time.time(), until, "it takes too long")
            time.sleep(0.02)

    def entry(self, name, line):
        path = self.path("vendors", name)
        pathlib.Path(path).write_text(line)
        return path

    def library(self, name, code, *flags):
        """Compiles a library. Returns its path."""
        if not COMPILER:
            self.skipTest("no C compiler")
        path = self.path(name)
        done = subprocess.run([COMPILER, "-shared", "-fPIC", "-x", "c", "-", "-x", "none", "-o", path, *flags], input=code, text=True, capture_output=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return path

    def whole_entry(self):
        """Returns one of this system's drivers that has a device, and its devices."""
        for path in sorted(glob.glob(USUAL + "/*.icd")):
            line = pathlib.Path(path).read_text()
            copy = self.entry("whole.icd", line)
            _, result, _ = self.doctor()
            if result["devices"]:
                return result["devices"]
            os.remove(copy)
        self.skipTest("no driver here that gives a device without the variables of the environment")

    def finding(self, result, kind, about=None):
        found = [f for f in result["findings"] if f["kind"] == kind and about in (None, f["about"])]
        self.assertEqual(len(found), 1, result["findings"])
        return found[0]

    def test_nothing_is_wrong(self):
        devices = self.whole_entry()
        code, result, text = self.doctor()
        self.assertEqual((code, result["findings"], result["usable"]), (0, [], True), text)
        self.assertIn("Nothing is wrong", text)
        listed = json.loads(self.succeeds("devices", "--json", env={"OCL_ICD_VENDORS": self.path("vendors")})[0])
        self.assertEqual([(d["index"], d["platform"], d["device"], d["type"], d["name"], d["driver"], d["memory"]) for d in listed],
                         [(d["index"], d["platform"], d["device"], d["type"], d["name"], d["driver"], d["memory"]) for d in devices])
        self.assertEqual([d["state"] for d in result["drivers"]], ["loaded"])

    def test_no_entry(self):
        code, result, _ = self.doctor()
        self.assertEqual((code, result["usable"], result["devices"]), (1, False, []))
        found = self.finding(result, "no_entry", self.path("vendors"))
        self.assertIn("holds no entry", found["found"])
        self.assertRegex(found["mend"], r"install a driver|write the line `/\S+` into \S+\.icd")

    def test_a_variable_that_points_nowhere(self):
        for place in (self.path("nowhere"), self.path("nowhere.icd"), "/nowhere/at/all"):
            code, result, text = self.doctor(OCL_ICD_VENDORS=place)
            self.assertEqual((code, result["usable"]), (1, False))
            found = self.finding(result, "variable_names_nothing", "OCL_ICD_VENDORS")
            self.assertIn(f"OCL_ICD_VENDORS={place} is not there", found["found"])
            self.assertIn("`unset OCL_ICD_VENDORS`", found["mend"])
            self.assertIn("device   none", text)

    def test_an_entry_whose_library_is_missing(self):
        devices = self.whole_entry()
        entry = self.entry("gone.icd", "/opt/gone/libgone.so.1\n")
        code, result, _ = self.doctor()
        found = self.finding(result, "library_missing", entry)
        self.assertIn('"/opt/gone/libgone.so.1", which is not there', found["found"])
        self.assertIn(f"mv {entry} {entry}.off", found["mend"])
        self.assertEqual((code, result["devices"]), (1, devices), "the other driver is still looked at")
        # If a library of that name exists elsewhere, the remedy says where.
        os.mkdir(self.path("elsewhere"))
        there = self.library("elsewhere/libgone.so.1", "int gone;")
        _, result, _ = self.doctor(LD_LIBRARY_PATH=self.path("elsewhere"))
        self.assertIn(f"it is at {there}: write that line into {entry}", self.finding(result, "library_missing")["mend"])

    def test_a_dependency_that_is_missing(self):
        self.library("libneeded.so.7", "int needed(void) { return 7; }", "-Wl,-soname,libneeded.so.7")
        library = self.library("libneeds.so", "int needed(void); int needs(void) { return needed(); }", "-Wl,--no-as-needed", self.path("libneeded.so.7"))
        entry = self.entry("needs.icd", library + "\n")
        os.mkdir(self.path("aside"))
        os.rename(self.path("libneeded.so.7"), self.path("aside", "libneeded.so.7"))
        _, result, _ = self.doctor()
        found = self.finding(result, "dependency_missing", entry)
        self.assertIn('needs "libneeded.so.7": that is not there', found["found"])
        self.assertIn("libneeded.so.7", found["mend"])
        _, result, _ = self.doctor(LD_LIBRARY_PATH=self.path("aside"))
        found = self.finding(result, "no_driver", entry)                   # it can be loaded now, but is no driver
        self.assertIn("it has no clGetExtensionFunctionAddress", found["found"])

    def test_a_library_that_cannot_be_loaded(self):
        pathlib.Path(self.path("libtext.so")).write_text("no library\n")
        entry = self.entry("text.icd", self.path("libtext.so") + "\n")
        _, result, _ = self.doctor()
        self.assertRegex(self.finding(result, "library_broken", entry)["found"], r"cannot be loaded: .*(file too short|invalid ELF header)")

    def test_a_library_that_crashes_when_it_is_loaded(self):
        devices = self.whole_entry()
        library = self.library("libcrash.so", '#include <stdio.h>\n#include <stdlib.h>\n__attribute__((constructor)) static void begin(void) {\n'
                               '  fputs("crash: not on this machine\\n", stderr);\n  abort();\n}\n')
        entry = self.entry("crash.icd", library + "\n")
        code, result, text = self.doctor()
        found = self.finding(result, "driver_crashes", entry)
        for words in (library, "crashes when it is loaded", "signal 6", "crash: not on this machine"):
            self.assertIn(words, found["found"])
        self.assertIn(f"mv {entry} {entry}.off", found["mend"])
        self.assertEqual((code, result["usable"]), (1, False), "a program loads all of them, and ends with that one")
        whole = [d for d in result["drivers"] if d["entry"] == self.path("vendors", "whole.icd")]
        self.assertEqual([d["name"] for p in whole[0]["platforms"] for d in p["devices"]], [d["name"] for d in devices])
        self.assertIn("crash.icd", text)
        os.rename(entry, entry + ".off")                                 # the remedy
        self.assertEqual(self.doctor()[0], 0)

    def test_a_library_that_hangs_when_it_is_loaded(self):
        library = self.library("libhang.so", "#include <unistd.h>\n__attribute__((constructor)) static void begin(void) {\n  for (;;) pause();\n}\n")
        entry = self.entry("hang.icd", library + "\n")
        _, result, _ = self.doctor("--seconds", 1)
        self.assertIn("hangs when it is loaded (not done after 1 s)", self.finding(result, "driver_hangs", entry)["found"])
        # A user who does not want to wait can interrupt it.
        doctor = subprocess.Popen([support.VSPLAT, "doctor", "--seconds", "100"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                  env={**os.environ, "OCL_ICD_VENDORS": self.path("vendors"), "OCL_ICD_FILENAMES": ""})
        self.wait_until(lambda: children_of(doctor.pid))
        [child] = children_of(doctor.pid)
        doctor.send_signal(signal.SIGINT)
        self.assertEqual(doctor.wait(30), -signal.SIGINT)
        self.wait_until(lambda: state_of(child)[0] in "ZX")

    def test_what_starts_it_may_take_no_notice_of_its_children(self):
        """Then the exit status of a process that examines a driver is lost; what it has reported counts."""
        devices = self.whole_entry()
        quits = self.entry("quits.icd", self.library("libquits.so", "#include <stdlib.h>\n__attribute__((constructor)) static void begin(void) {\n  exit(4);\n}\n") + "\n")
        before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)                    # inherited by the programs that it starts
        try:
            with open(self.path("output.json"), "w") as out:
                doctor = subprocess.Popen([support.VSPLAT, "doctor", "--json", "--seconds", "30"], stdout=out, stderr=subprocess.DEVNULL, restore_signals=False,
                                          env={**os.environ, "OCL_ICD_VENDORS": self.path("vendors"), "OCL_ICD_FILENAMES": "", "VSPLAT_DEVICE": ""})
                doctor.wait(support.PATIENCE)
        finally:
            signal.signal(signal.SIGCHLD, before)
        result = json.loads(pathlib.Path(self.path("output.json")).read_text())
        self.assertIn("crashes when it is loaded", self.finding(result, "driver_crashes", quits)["found"])
        whole = next(d for d in result["drivers"] if d["entry"] != quits)
        self.assertEqual((whole["state"], sum(len(p["devices"]) for p in whole["platforms"])), ("loaded", len(devices)))

    def test_a_driver_that_ends_when_it_is_asked(self):
        library = self.library("libquits.so", '#include <stdlib.h>\nint ids(unsigned n, void** out, unsigned* count) { exit(4); }\n'
                               'void* clGetExtensionFunctionAddress(const char* name) { return (void*)ids; }\n')
        entry = self.entry("quits.icd", library + "\n")
        _, result, _ = self.doctor()
        self.assertIn("crashes when it is asked for its platforms (exit code 4)", self.finding(result, "driver_crashes", entry)["found"])

    def test_wrong_entries(self):
        empty, windows = self.entry("empty.icd", ""), self.entry("windows.icd", "libOpenCL.so.1\r\n")
        _, result, _ = self.doctor()
        self.assertIn("is empty", self.finding(result, "entry_wrong", empty)["found"])
        self.assertIn("carriage return", self.finding(result, "entry_wrong", windows)["found"])
        self.assertIn("`libOpenCL.so.1`", self.finding(result, "entry_wrong", windows)["mend"])

    def test_a_driver_without_an_entry(self):
        devices = self.whole_entry()
        os.mkdir(self.path("driver"))
        library = self.library("driver/libnvidia-opencl.so.1", "int nvidia;")
        code, result, _ = self.doctor(LD_LIBRARY_PATH=self.path("driver"))
        found = self.finding(result, "library_without_entry", library)
        entry = self.path("vendors", "nvidia.icd")
        self.assertIn(f"write the line `{library}` into {entry} (`mkdir -p {self.path('vendors')} && echo {library} > {entry}`)", found["mend"])
        self.assertEqual((code, result["devices"]), (1, devices))
        # A GPU's driver without the GPU's device files, as in a container that was not given them.
        if not glob.glob("/dev/nvidia[0-9]*"):
            found = self.finding(result, "no_gpu_files", "/dev/nvidia0")
            self.assertIn("`--gpus all` and `-e NVIDIA_DRIVER_CAPABILITIES=compute,utility`", found["mend"])
        # The remedy works: the entry is examined (and names no driver here).
        command = re.search(r"`(mkdir [^`]*)`", self.finding(result, "library_without_entry")["mend"]).group(1)
        subprocess.run(["sh", "-c", command], check=True)
        _, result, _ = self.doctor(LD_LIBRARY_PATH=self.path("driver"))
        self.assertEqual(self.finding(result, "no_driver")["about"], entry)
        self.assertFalse([f for f in result["findings"] if f["kind"] == "library_without_entry"])

    def test_a_home_that_cannot_be_written(self):
        devices = self.whole_entry()
        with open(self.path("file"), "w"):
            pass
        home = self.path("file", "home")                                 # root may write anywhere, but not below a file
        unset = {"VSPLAT_CACHE_DIR": "", "POCL_CACHE_DIR": "", "XDG_CACHE_HOME": ""}
        code, result, _ = self.doctor(HOME=home, **unset)
        self.assertEqual(code, 1)
        found = self.finding(result, "cache_folder", home + "/.cache/vsplat")
        self.assertIn("(HOME says so) cannot be written", found["found"])
        self.assertIn("set VSPLAT_CACHE_DIR to a folder that can be written, or HOME to one above it", found["mend"])
        if devices[0]["platform_name"] == "Portable Computing Language":
            found = self.finding(result, "cache_folder", home + "/.cache/pocl/kcache")
            self.assertIn("PoCL gives no device", found["found"])
            self.assertIn("set POCL_CACHE_DIR", found["mend"])
        code, result, _ = self.doctor(HOME=home, **{**unset, "VSPLAT_CACHE_DIR": self.path("cache"), "POCL_CACHE_DIR": self.path("pocl")})
        self.assertEqual((code, result["usable"]), (0, True), result["findings"])

    def test_a_cache_that_others_may_write_to(self):
        self.whole_entry()
        os.mkdir(self.path("cache"))
        os.chmod(self.path("cache"), 0o777)
        code, result, _ = self.doctor(VSPLAT_CACHE_DIR=self.path("cache"))
        self.assertEqual(code, 1)
        self.assertIn("chmod go-w", self.finding(result, "cache_folder", self.path("cache"))["mend"])

    def test_a_device_that_is_not_there(self):
        self.whole_entry()
        code, result, _ = self.doctor(VSPLAT_DEVICE="quantum")
        self.assertEqual(code, 1)
        self.assertIn("VSPLAT_DEVICE=quantum names none of the devices", self.finding(result, "device_not_there")["found"])

    def test_a_missing_device_says_where_to_ask(self):
        err = self.refuses(1, "no OpenCL device", "kernels", "--for", "render", "--no-build", env={"OCL_ICD_VENDORS": self.path("vendors")})
        self.assertIn("`vsplat doctor`", err)


if __name__ == "__main__":
    support.main()
