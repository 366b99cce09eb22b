"""Profiles of whole runs: a cold one, whose kernels are compiled, and a warm one, against the clock outside."""
import json
import os
import time
import unittest

import support

PARTS = ("device_s", "upload_s", "compile_s", "file_s", "wait_s", "host_s", "other_s")
# Beside 2 % of the wall: starting the process and ending it, which its own clock does not see.
OUTSIDE = 0.15


class Profile(support.Case):
    def cold(self):
        """Where nothing is cached."""
        return {"HOME": self.path("home"), "XDG_CACHE_HOME": self.path("home"), "POCL_CACHE_DIR": self.path("pocl"),
                "VSPLAT_CACHE_DIR": self.path("kernels")}

    def run_timed(self, name, env, *more):
        """-> the profile, seconds outside"""
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
        self.assertGreaterEqual(wall + profile["peaks"]["measuring_s"], 0.98 * outside - OUTSIDE)
        self.assertAlmostEqual(sum(profile["wall"][part] for part in PARTS), wall, delta=1e-6)
        self.assertAlmostEqual(sum(stage["wall_s"] for stage in profile["stages"]), wall, delta=1e-6)
        for part in PARTS:
            self.assertAlmostEqual(sum(stage[part] for stage in profile["stages"]), profile["wall"][part], delta=1e-6)
        kernels = sum(kernel["total_ns"] for kernel in profile["kernels"]) * 1e-9
        self.assertAlmostEqual(kernels, profile["kernels_s"], delta=1e-6)
        self.assertAlmostEqual(sum(stage["kernels_s"] for stage in profile["stages"]), kernels, delta=1e-6)
        self.assertLess(profile["wall"]["other_s"], 0.02 * wall + 0.05)         # what nobody accounts for
        for kernel in profile["kernels"]:
            self.assertEqual(sum(variant["calls"] for variant in kernel["launches"]), kernel["calls"])
            self.assertEqual(sum(variant["total_ns"] for variant in kernel["launches"]), kernel["total_ns"])

    def test_cold_and_warm(self):
        env = self.cold()
        cold, outside = self.run_timed("cold.json", env)
        self.holds(cold, outside)
        self.assertGreater(cold["wall"]["compile_s"], 0.3 * cold["wall_s"])
        self.assertGreater(cold["peaks"]["measuring_s"], 0)
        warm, outside = self.run_timed("warm.json", env)
        self.assertEqual(warm["peaks"]["measured"], cold["peaks"]["measured"])
        self.holds(warm, outside)
        self.assertLess(warm["wall_s"], cold["wall_s"])
        self.assertLess(warm["wall"]["compile_s"], cold["wall"]["compile_s"])
        for profile in (cold, warm):
            self.assertTrue(all(kernel["bound"] in ("compute", "memory", "latency", "none") for kernel in profile["kernels"]))
            self.assertTrue(all(kernel["share_of_peak"] >= 0 for kernel in profile["kernels"]))
            kinds = {row["kind"] for row in profile["host"]}
            self.assertLessEqual({"host", "file", "compile", "upload"}, kinds)
            names = {row["name"] for row in profile["host"]}
            self.assertLessEqual({"views load", "model load", "reconstruct", "render", "scene save", "read"}, names)
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

    def test_verbose_prints_tables(self):
        _, err = self.succeeds(*self.reconstruct("--verbose"))
        for word in ("Kernel", "Host", "Stage (s)", "scene save"):
            self.assertIn(word, err)


if __name__ == "__main__":
    unittest.main()
