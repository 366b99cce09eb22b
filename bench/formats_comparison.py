#!/usr/bin/env python3
"""Converts a PLY scene to other formats and back by vsplat and by splat-transform, in turn, and prints seconds, peak memory and bytes.

    bench/formats_comparison.py --vsplat build/release/bin/vsplat [--splat-transform PROGRAM] [--repeats 3] SCENE.ply...

splat-transform is the npm package @playcanvas/splat-transform; without it only vsplat is timed. It runs without a GPU. Each program
starts anew for every conversion, so its start counts. Seconds are medians of the repeats, which end once they have taken a minute.
Peak memory is the largest resident size of the process and its children, also as a multiple of the scene's file. The table (Markdown)
goes to standard output.
"""
import argparse
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

FORMATS = ("spz", "sog", "compressed.ply", "glb", "splat")


def timed(words):
    """Seconds and peak bytes of one run, or None if it fails."""
    start = time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    error = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        print(f"{words[0]} failed: {error.decode(errors='replace').strip()[-300:]}", file=sys.stderr)
        return None
    return time.monotonic() - start, usage.ru_maxrss * 1024


def vsplat(program, source, target):
    return [program, "convert", source, target, "--overwrite", "--quiet"]


def splat_transform(program, source, target):
    return [program, "-w", "-g", "cpu", source, target]


def row(name, what, runs, scene_bytes, file_bytes):
    seconds = statistics.median(r[0] for r in runs)
    peak = max(r[1] for r in runs)
    return f"| {what} | {name} | {seconds:.2f} | {peak / 2**20:.0f} | {peak / scene_bytes:.2f} | {file_bytes / 1e6:.1f} |"


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("scenes", nargs="+", type=pathlib.Path, metavar="SCENE.ply")
    ap.add_argument("--vsplat", default="build/release/bin/vsplat")
    ap.add_argument("--splat-transform", default=shutil.which("splat-transform"))
    ap.add_argument("--repeats", type=int, default=3)
    ap.add_argument("--formats", nargs="+", default=FORMATS)
    a = ap.parse_args()
    programs = {"vsplat": (vsplat, a.vsplat)}
    if a.splat_transform:
        programs["splat-transform"] = (splat_transform, a.splat_transform)
    for scene in a.scenes:
        scene_bytes = scene.stat().st_size
        print(f"{scene.name}, {scene_bytes / 1e6:.1f} MB\n\n| conversion | program | s | peak MiB | peak / PLY | MB written |\n"
              "| --- | --- | ---: | ---: | ---: | ---: |")
        with tempfile.TemporaryDirectory() as folder:
            for ending in a.formats:
                for back in (False, True):
                    runs = {name: [] for name in programs}
                    for _ in range(a.repeats):
                        for name, (words, program) in programs.items():
                            if sum(r[0] for r in runs[name]) > 60:
                                continue
                            stored, again = (pathlib.Path(folder, f"{name}.{end}") for end in (ending, "again.ply"))
                            source, target = (stored, again) if back else (scene, stored)
                            result = timed(words(program, source, target)) if source.exists() else None
                            if result:
                                runs[name].append(result)
                    for name, results in runs.items():
                        what = f"{ending} to PLY" if back else f"PLY to {ending}"
                        written = pathlib.Path(folder, f"{name}.{'again.ply' if back else ending}")
                        print(row(name, what, results, scene_bytes, written.stat().st_size) if results
                              else f"| {what} | {name} | fails | | | |", flush=True)
        print()


if __name__ == "__main__":
    main()
