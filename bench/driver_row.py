#!/usr/bin/env python3
"""Prints a row of the table of drivers in bench/results/README.md: what holds on an OpenCL device, and what it takes.

  bench/driver_row.py BUILD [--only commands|tests] [--tests FILTER] [--limit SECONDS] [--steps N]

BUILD is a build folder with tests, such as build/release. The device is that of $VSPLAT_DEVICE; variables such as
OCL_ICD_VENDORS choose the driver. Kernels are compiled anew in caches of their own, so the first reconstruction shows
what a new user waits for. A test that crashes or runs into the limit is reported as such; the row is printed all the same.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
OBJECT = os.path.join(HERE, "..", "examples", "data", "garden_gnome")
GOLDEN = (("network_tests", "*GoldenModel*"), ("splat_tests", "*Golden*"))


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--tests", default="*", metavar="FILTER", help="of the tests of operations, as --gtest_filter (default: all)")
    parser.add_argument("--only", choices=("commands", "tests"), help="only times commands, or only tests (default: both)")
    parser.add_argument("--limit", type=float, default=1800, metavar="SECONDS", help="of each program (default: 1800)")
    parser.add_argument("--steps", type=int, default=100, help="steps of the fit (default: 100)")
    return parser.parse_args()


class Runs:
    def __init__(self, build, folder, limit):
        self.build, self.folder, self.limit = os.path.abspath(build), folder, limit
        self.environment = dict(os.environ, POCL_CACHE_DIR=folder + "/pocl", XDG_CACHE_HOME=folder + "/cache")

    def run(self, *command):
        """The exit code (None: the limit was reached), what was printed, and the seconds."""
        begun = time.monotonic()
        try:
            done = subprocess.run(command, env=self.environment, cwd=self.folder, timeout=self.limit, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True, errors="replace")
            return done.returncode, done.stdout, time.monotonic() - begun
        except subprocess.TimeoutExpired as e:
            out = e.stdout or b""
            return None, out.decode(errors="replace") if isinstance(out, bytes) else out, time.monotonic() - begun

    def tests(self, program, tests):
        """How many tests passed, failed and were skipped, whether all ran, and the seconds."""
        code, text, seconds = self.run(f"{self.build}/tests/{program}", f"--gtest_filter={tests}")
        passed = len(re.findall(r"^\[       OK \]", text, re.M))
        failed = re.findall(r"^\[  FAILED  \] (\S+?),? .*\(\d+ ms\)", text, re.M)
        skipped = len(re.findall(r"^\[  SKIPPED \] \S+ \(\d+ ms\)", text, re.M))
        end = "" if code in (0, 1) else ", limit reached" if code is None else f", ended by {-code}"
        for name in failed:
            print(f"  failed: {program} {name}", file=sys.stderr)
        if end:
            print(f"  {program}{end} in", (re.findall(r"^\[ RUN      \] (\S+)", text, re.M) or ["its start"])[-1], file=sys.stderr)
        return passed, len(failed), skipped, end, seconds

    def command(self, *arguments):
        code, text, seconds = self.run(f"{self.build}/bin/vsplat", *arguments)
        if code != 0:
            print("  vsplat " + " ".join(arguments[:2]) + " failed:", text.strip().splitlines()[-1] if text.strip() else code,
                  file=sys.stderr)
        return (f"{seconds:.1f}" if code == 0 else "-"), text


def summary(passed, failed, skipped, end, seconds):
    return f"{passed} of {passed + failed}" + (f", {skipped} skipped" if skipped else "") + end + f", {seconds:.0f} s"


def time_commands(runs, steps):
    first, _ = runs.command("reconstruct", OBJECT, "-o", "a.ply", "-w")
    again, _ = runs.command("reconstruct", OBJECT, "-o", "a.ply", "-w")
    draw = ("render", "a.ply", "--cameras", "orbit:24", "--size", "512x512", "--images", "turn", "-w")
    runs.command(*draw)
    render, _ = runs.command(*draw)
    fit = ("fit", OBJECT, "--start", "a.ply", "-o", "b.ply", "-w", "--page", "none", "--holdout", "none", "--steps")
    runs.command(*fit, "2")
    fitted, _ = runs.command(*fit, str(steps))
    print("| first reconstruct, s | reconstruct | render 24 pictures | fit of", steps, "steps |")
    print(f"| {first} | {again} | {render} | {fitted} |", flush=True)


def test(runs, tests):
    code, found, seconds = runs.run(f"{runs.build}/bin/vsplat", "selftest", "--quick")
    if code != 0:
        print("  selftest:", "\n    ".join(found.strip().splitlines()[-12:]), file=sys.stderr)
    print("| selftest --quick | golden vectors | tests of operations |")
    print(f"| {'ok' if code == 0 else 'limit reached' if code is None else f'exit {code}'}, {seconds:.0f} s ", end="", flush=True)
    golden = [runs.tests(*each) for each in GOLDEN]
    total = [sum(g[i] for g in golden) for i in range(3)]
    print("|", summary(*total, "".join(g[3] for g in golden), sum(g[4] for g in golden)), end=" ", flush=True)
    print("|", summary(*runs.tests("ops_tests", tests)), "|", flush=True)


def main():
    asked = parsed()
    with tempfile.TemporaryDirectory() as folder:
        runs = Runs(asked.build, folder, asked.limit)
        print(runs.command("devices", "--json")[1], flush=True)
        if asked.only != "tests":
            time_commands(runs, asked.steps)
        if asked.only != "commands":
            test(runs, asked.tests)


if __name__ == "__main__":
    main()
