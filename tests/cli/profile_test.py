"""Profiles of whole runs, a cold one, which compiles kernels, and a warm one, compared with a clock outside."""
import json
import os
import pathlib
import re
import time
import unittest

import support

PARTS = ("device_s", "upload_s", "compile_s", "file_s", "wait_s", "host_s", "other_s")
# In addition to 2 % of the wall time: starting and ending the process, which its own clock does not see.
OUTSIDE = 1.5 if "ASAN_OPTIONS" in os.environ else 0.15  # a sanitizer searches for leaks at the end
TRIES = 5  # A loaded machine may let a process wait before its start. A part that the profile leaves out is missing every time.


class Profile(support.Case):
    def cold(self):
        """With empty caches."""
        return {"HOME": self.path("home"), "XDG_CACHE_HOME": self.path("home"), "POCL_CACHE_DIR": self.path("pocl"),
                "VSPLAT_CACHE_DIR": self.path("kernels")}

    def read(self, name):
        return pathlib.Path(self.path(name)).read_bytes()

    def run_timed(self, name, env, *more):
        """Returns the profile, and the seconds measured outside."""
        for folder in ("home", "pocl"):
            os.makedirs(self.path(folder), exist_ok=True)
        begun = time.monotonic()
        self.succeeds(*self.reconstruct("--render", "orbit:2", "--images", self.path("pictures"), "--size", "32x32", "--profile", self.path(name),
                                        "--overwrite", *more), env=env)
        outside = time.monotonic() - begun
        with open(self.path(name)) as f:
            return json.load(f), outside

    def holds(self, profile, outside):
        wall = profile["wall_s"]
        self.assertLessEqual(wall, outside)
        self.assertAlmostEqual(sum(profile["wall"][part] for part in PARTS), wall, delta=1e-6)
        self.assertAlmostEqual(sum(stage["wall_s"] for stage in profile["stages"]), wall, delta=1e-6)
        for part in PARTS:
            self.assertAlmostEqual(sum(stage[part] for stage in profile["stages"]), profile["wall"][part], delta=1e-6)
        kernels = sum(kernel["total_ns"] for kernel in profile["kernels"]) * 1e-9
        self.assertAlmostEqual(kernels, profile["kernels_s"], delta=1e-6)
        self.assertAlmostEqual(sum(stage["kernels_s"] for stage in profile["stages"]), kernels, delta=1e-6)
        self.assertLess(profile["wall"]["other_s"], 0.02 * wall + 0.05)         # time that is not attributed
        for kernel in profile["kernels"]:
            self.assertEqual(sum(variant["calls"] for variant in kernel["launches"]), kernel["calls"])
            self.assertEqual(sum(variant["total_ns"] for variant in kernel["launches"]), kernel["total_ns"])

    def unseen(self, profile, outside):
        """Seconds of the process's life that its profile does not account for, above what is allowed."""
        return 0.98 * outside - OUTSIDE - profile["wall_s"] - profile["peaks"]["measuring_s"]

    def test_cold_and_warm(self):
        env = self.cold()
        cold, outside = self.run_timed("cold.json", env)
        self.holds(cold, outside)
        self.assertGreater(cold["wall"]["compile_s"], 0.3 * cold["wall_s"])
        self.assertGreater(cold["peaks"]["measuring_s"], 0)
        unseen = [self.unseen(cold, outside)]
        self.assertLess(unseen[0], 0.1 * outside)
        warm, outside = self.run_timed("warm.json", env)
        self.assertEqual(warm["peaks"]["measured"], cold["peaks"]["measured"])
        self.holds(warm, outside)
        unseen.append(self.unseen(warm, outside))
        while min(unseen) > 0 and len(unseen) < TRIES:
            unseen.append(self.unseen(*self.run_timed("warm.json", env)))
        self.assertLessEqual(min(unseen), 0, unseen)
        self.assertLess(warm["wall_s"], cold["wall_s"])
        self.assertLess(warm["wall"]["compile_s"], cold["wall"]["compile_s"])
        out, _ = self.succeeds("profile", "diff", self.path("cold.json"), self.path("warm.json"))
        self.assertRegex(out, r"(?m)^ *compile .* -[0-9.]+ %")
        code, _, err = support.run("profile", "diff", self.path("warm.json"), self.path("cold.json"), "--fail-above", "5%")
        self.assertEqual(code, 1, err)
        self.assertIn("wall", err)
        for profile in (cold, warm):
            self.assertTrue(all(kernel["bound"] in ("compute", "memory", "latency", "none") for kernel in profile["kernels"]))
            self.assertTrue(all(kernel["share_of_peak"] >= 0 for kernel in profile["kernels"]))
            kinds = {row["kind"] for row in profile["host"]}
            self.assertLessEqual({"host", "file", "compile", "upload"}, kinds)
            names = {row["name"] for row in profile["host"]}
            self.assertLessEqual({"views load with", "model load", "reconstruct", "render", "scene save with", "read"}, names)
            self.assertEqual(profile["run"], {"command": "reconstruct", "model": self.model, "scene": self.views})
            firsts = [kernel for kernel in profile["kernels"] if kernel["first_calls"]]
            self.assertTrue(firsts)
            self.assertTrue(all(kernel["first_ns"] <= kernel["total_ns"] for kernel in firsts))

    def test_the_timeline_has_lanes_by_name(self):
        self.succeeds(*self.reconstruct("--trace", self.path("t.json")))
        with open(self.path("t.json")) as f:
            events = json.load(f)["traceEvents"]
        lanes = {event["args"]["name"]: event["tid"] for event in events if event["name"] == "thread_name"}
        self.assertLessEqual({"device: running", "host", "file", "compile", "upload"}, lanes.keys())
        spans = [event for event in events if event["ph"] == "X"]
        for name in ("device: running", "host", "file", "compile", "upload"):
            self.assertTrue(any(span["tid"] == lanes[name] for span in spans), name)
        running = sorted((span["ts"], span["dur"]) for span in spans if span["tid"] == lanes["device: running"])
        self.assertTrue(all(a[0] + a[1] <= b[0] + 1 for a, b in zip(running, running[1:])), "a queue in order runs one after the other")
        waiting = [event for event in events if event["ph"] == "C"]
        self.assertTrue(waiting and all({"queued", "submitted"} == event["args"].keys() for event in waiting))
        self.assertEqual(waiting[-1]["args"], {"queued": 0, "submitted": 0})

    def test_a_page_needs_nothing_else(self):
        self.succeeds(*self.reconstruct("--profile", self.path("p.html")))
        page = self.read("p.html").decode()
        self.assertNotIn("http:", page)
        self.assertNotIn("https:", page)
        self.assertNotRegex(page, r"<(?:link|img|iframe)|src=|url\(|@import")
        self.assertEqual(page.count("<script"), 2)
        data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1])
        self.assertAlmostEqual(sum(data["profile"]["wall"][part] for part in PARTS), data["profile"]["wall_s"], delta=1e-6)
        wall = data["profile"]["wall_s"]
        for row, start, length, first in data["timeline"]["launches"]:
            self.assertLess(row, len(data["profile"]["kernels"]))
            self.assertLessEqual(start + length, wall + 1e-3)
        self.assertEqual(len(data["timeline"]["launches"]), sum(kernel["calls"] for kernel in data["profile"]["kernels"]))
        self.assertTrue(data["timeline"]["host"])

    def test_names_of_strangers_end_no_element(self):
        os.rename(self.path("views"), self.path("x<"))
        os.rename(self.path("x<", "transforms.json"), self.path("x<", "script><b>.json"))  # its path contains </script>
        self.succeeds("reconstruct", self.path("x<", "script><b>.json"), "--model", self.model, "--output", self.path("s.ply"), "--profile",
                      self.path("p.html"))
        page = self.read("p.html").decode()
        self.assertNotIn("<b>.json", page)
        self.assertEqual(page.count("</script>"), 2)

    def test_blending_is_counted(self):
        profiles = []
        for name in ("a.json", "b.json"):
            self.succeeds(*self.reconstruct("--render", "orbit:2", "--images", self.path("pictures"), "--profile", self.path(name), "--overwrite"))
            with open(self.path(name)) as f:
                profiles.append([k for k in json.load(f)["kernels"] if k["name"].startswith("rasterize_forward")])
        first, second = profiles
        self.assertTrue(first and all(k["counted"] > 0 and k["flops"] > 30 * k["counted"] for k in first))
        self.assertEqual([k["counted"] for k in first], [k["counted"] for k in second])

    def test_a_profile_changes_nothing(self):
        self.succeeds(*self.reconstruct("--render", "orbit:2", "--images", self.path("plain")))
        plain = self.read("out.ply")
        self.succeeds(*self.reconstruct("--render", "orbit:2", "--images", self.path("seen"), "--profile", self.path("p.json"), "--overwrite"))
        self.assertEqual(plain, self.read("out.ply"))
        for i in range(2):
            pictures = [support.read_png(self.path(folder, f"{i:04d}.png")) for folder in ("plain", "seen")]
            self.assertEqual(*pictures)

    def test_verbose_prints_tables(self):
        _, err = self.succeeds(*self.reconstruct("--verbose"))
        for word in ("Kernel", "Host", "Stage (s)", "programs"):
            self.assertIn(word, err)


class Diff(support.FolderCase):
    """Of profiles made here."""
    def write(self, name, encoder=1.0, splat=0.5, tiny=0.001, **changes):
        wall = encoder + splat + tiny
        parts = {part: 0.0 for part in PARTS} | {"device_s": wall}
        stage = lambda name, s: {"stage": name, "wall_s": s, "kernels_s": s, **{part: 0.0 for part in PARTS}, "device_s": s}
        kernel = lambda name, stage, s: {"name": name, "stage": stage, "calls": 1, "total_ns": int(s * 1e9)}
        profile = {"device": "a device", "driver": "1", "run": {"model": "m"}, "wall_s": wall, "wall": parts,
                   "kernels": [kernel("gemm", "encoder", encoder), kernel("rasterize", "splat", splat)], "kernels_s": wall,
                   "stages": [stage("encoder", encoder), stage("splat", splat), stage("", tiny)], **changes}
        path = os.path.join(self.folder, name)
        pathlib.Path(path).write_text(json.dumps(profile))
        return path

    def diff(self, *arguments):
        return support.run("profile", "diff", *arguments)

    def test_what_has_become_slower_ends_with_1(self):
        a, b = self.write("a.json"), self.write("b.json", splat=0.54)
        code, out, err = self.diff(a, b)
        self.assertEqual((code, err), (0, ""))
        self.assertRegex(out, r"splat +0.500 s +0.540 s +\+8.0 %")
        self.assertRegex(out, r"rasterize \(splat\) +0.500 s")
        self.assertEqual(self.diff(a, b, "--fail-above", "10%")[0], 0)
        code, _, err = self.diff(a, b, "--fail-above", "5%")
        self.assertEqual(code, 1)
        self.assertIn("slower by more than 5%: splat +8.0 %", err)
        self.assertNotIn("encoder", err)
        self.assertEqual(self.diff(b, a, "--fail-above", "5")[0], 0)    # faster

    def test_the_wall_counts_and_small_stages_do_not(self):
        a = self.write("a.json")
        self.assertEqual(self.diff(a, self.write("b.json", tiny=0.01), "--fail-above", "5%")[0], 0)
        code, _, err = self.diff(a, self.write("c.json", encoder=1.2, splat=0.6), "--fail-above", "5%")
        self.assertEqual(code, 1)
        for word in ("wall", "encoder", "splat"):
            self.assertIn(word, err)

    def test_json(self):
        code, out, err = self.diff(self.write("a.json"), self.write("b.json", splat=1.0), "--json", "--fail-above", "5%")
        found = json.loads(out)
        self.assertEqual(code, 1)
        self.assertEqual([row["name"] for row in found["slower"]], ["wall", "splat"])
        self.assertAlmostEqual(next(row for row in found["stages"] if row["name"] == "splat")["slower_by"], 1.0)

    def test_profiles_of_other_things_are_reported(self):
        _, _, err = self.diff(self.write("a.json"), self.write("b.json", device="another", driver="2"))
        self.assertIn("the devices differ: a device and another", err)
        self.assertIn("the drivers differ", err)

    def test_what_is_no_profile_is_refused(self):
        good = self.write("a.json")
        for text, word in (("{", "no JSON object"), ("[]", "no JSON object"), ("{}", "device"), ("[" * 100000, "profile")):
            path = os.path.join(self.folder, "bad.json")
            pathlib.Path(path).write_text(text)
            code, out, err = self.diff(good, path)
            self.assertEqual((code, out), (1, ""), err)
            self.assertIn("bad.json", err)
            self.assertIn(word, err)
        for changes, word in (({"wall_s": "long"}, "wall_s"), ({"wall": {}}, "device_s"), ({"stages": 3}, "stages"),
                              ({"kernels": [{"stage": "x", "total_ns": 1}]}, "name"), ({"wall_s": -1}, "wall_s")):
            code, _, err = self.diff(good, self.write("bad.json", **changes))
            self.assertEqual(code, 1)
            self.assertIn(word, err)
        self.assertEqual(self.diff(good, os.path.join(self.folder, "absent.json"))[0], 1)
        for share in ("much", "-5%", "", "nan"):
            self.assertEqual(self.diff(good, good, "--fail-above", share)[0], 2, share)


if __name__ == "__main__":
    unittest.main()
