"""A stem names one thing: no two folders have sources of the same stem, except the files of an operation, and a thing's C interface."""
import collections
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
INTERFACE = ("model/api", "model/api/include/vsplat")  # the C interface and its public headers
# Where an operation's files stand beside model/ops/<family>/, see "Adding an operation" in CONTRIBUTING.md.
OPERATION = ("bench", "bench/ops", "model/diagnose/selftest/cases", "model/diagnose/selftest/reference", "runtime")
# Things whose interface includes no header of the same stem, with how it comes to them.
SAME_THING = {
    "device": "by way of runtime/context.h",
    "opencl": "vsplat/opencl.h is for programs, which have OpenCL's headers of their own",
    "views": "by way of model/views/photographs.h",
}


def operations(sources):
    """The stems of operations: those of model/ops/, and what runtime/ multiplies matrices with."""
    return {path.stem for path in sources if path.parts[:2] == ("model", "ops")} | {"gemm", "compose_rows", "column_sum", "peak"}


def sources():
    return sorted(path.relative_to(ROOT) for top in ("runtime", "model", "bench") for path in (ROOT / top).rglob("*")
                  if path.suffix in {".c", ".cpp", ".h", ".hpp", ".S"})


def problems(paths, includes):
    """paths: of sources; includes {path: the headers that it includes} -> the stems that name several things, a line each."""
    by_stem = collections.defaultdict(list)
    for path in paths:
        by_stem[path.stem].append(path)
    names = operations(paths)
    out = []
    for stem, files in sorted(by_stem.items()):
        folders = {path.parent.as_posix() for path in files}
        if stem in names:
            folders = {folder for folder in folders if folder not in OPERATION and not folder.startswith("model/ops/")} | {"an operation"}
        interface = folders.intersection(INTERFACE)
        rest = folders.difference(INTERFACE)
        of_interface = {header for path in files if path.parent.as_posix() in INTERFACE for header in includes[path]}
        if interface and len(rest) == 1 and (stem in SAME_THING or f"{next(iter(rest))}/{stem}.h" in of_interface):
            continue
        if len(rest) + bool(interface) > 1:
            out.append(f"{stem}: {', '.join(sorted(folders))}")
    return out


class Stems(unittest.TestCase):
    def test_a_stem_names_one_thing(self):
        paths = sources()
        self.assertGreater(len(paths), 800)
        includes = {path: re.findall(r'#\s*include\s*"([^"]+)"', (ROOT / path).read_text(errors="replace")) for path in paths}
        self.assertEqual(problems(paths, includes), [])

    def test_what_would_be_found(self):
        made = [pathlib.Path(name) for name in ("model/ops/dense/rope.h", "bench/ops/rope.cpp", "model/base/rope.h", "runtime/ranks.h",
                                                "model/api/ranks.cpp", "model/cli/jobs.cpp", "model/api/jobs.cpp")]
        includes = {path: [] for path in made} | {made[4]: ["runtime/ranks.h"]}
        self.assertEqual(problems(made, includes), ["jobs: model/api, model/cli", "rope: an operation, model/base"])


if __name__ == "__main__":
    unittest.main()
