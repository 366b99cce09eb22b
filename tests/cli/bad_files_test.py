"""Gives wrong files and folders to every option that takes one: the command ends with 1 or 2, names the file, and leaves nothing behind.
An option that --help lists and no row here tries is a failure."""
import concurrent.futures
import json
import os
import pathlib
import random
import re
import shutil
import sys
import tempfile
import unittest

import support

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "hostile"))
import rule  # noqa: E402

COMMANDS = ("reconstruct", "fit", "render", "convert", "info", "mesh", "init", "weights info", "weights verify", "weights convert", "weights import", "devices",
            "doctor", "report", "kernels", "tune", "selftest", "bench", "profile diff", "dataset render", "dataset procedural", "dataset info",
            "train", "evaluate")
# The words by which --help stands for a file or a folder.
PLACES = re.compile(r"\b(FILE|DIR|SCENE|MODEL|CAMERAS|VIEWS|MESH|PICTURE|TABLE|RUN|CONFIG|BEFORE|AFTER|OLD)\b")
LISTED = re.compile(r"^  (?:-\w,)?(--[a-z-]+|[a-z]+) ([A-Z][^ ]*)")

SMALL = ("--max-memory", "0.5")
RENDER = ("render", "{scene}", "--size", "16x16", *SMALL)
RECONSTRUCT = ("reconstruct", "{object}", "--output", "{out}/s.ply", "--model", "{model}", *SMALL)
FIT = ("fit", "{object}", "--output", "{out}/s.ply", "--steps", "1", "--size", "16", *SMALL)
TRAIN = ("train", "{config}", "--output", "{out}/run", *SMALL)
EVALUATE = ("evaluate", "{object}", "--model", "{model}", *SMALL)
BENCH = ("bench", "--seconds", "0.01", "--run", "layer_norm", *SMALL)
PROFILED = {"render": (*RENDER, "--cameras", "orbit:1", "--images", "{out}/x"), "reconstruct": RECONSTRUCT, "fit": (*FIT, "--start", "{scene}"),
            "mesh": ("mesh", "{scene}", "--voxels", "16", *SMALL, "--output", "{out}/m.ply"), "train": (*TRAIN, "--data", "{set}"), "evaluate": EVALUATE, "bench": BENCH}

# (command and option, ending of the files, arguments with {bad}, kinds that are accepted)
READ = [
    ("reconstruct VIEWS", "", ("reconstruct", "{bad}", "--output", "{out}/s.ply", "--model", "{model}", *SMALL), ()),
    ("reconstruct --model", ".safetensors", ("reconstruct", "{object}", "--output", "{out}/s.ply", "--model", "{bad}", *SMALL), ("model",)),
    ("reconstruct --pictures", "", (*RECONSTRUCT, "--pictures", "{bad}"), ()),
    ("reconstruct --render", "", (*RECONSTRUCT, "--render", "{bad}", "--images", "{out}/x"), ()),
    ("reconstruct --render path", "", (*RECONSTRUCT, "--render", "path:{bad}:3", "--images", "{out}/x"), ()),
    ("reconstruct --compare", "", (*RECONSTRUCT, "--render", "{object}", "--size", "16x16", "--compare", "{bad}"), ()),
    ("reconstruct --selection", ".txt", (*RECONSTRUCT, "--selection", "{bad}"), ("empty",)),
    ("reconstruct --list", ".txt", ("reconstruct", "--list", "{bad}", "--output", "{out}/all", "--model", "{model}", *SMALL), ()),
    ("fit VIEWS", "", ("fit", "{bad}", "--start", "{scene}", "--output", "{out}/s.ply", "--steps", "1", *SMALL), ()),
    ("fit --start", ".ply", (*FIT, "--start", "{bad}"), ("scene",)),
    ("fit --pictures", "", (*FIT, "--start", "{scene}", "--pictures", "{bad}"), ()),
    ("fit --model", ".safetensors", (*FIT, "--start", "network", "--model", "{bad}"), ("model",)),
    ("fit --checkpoint", "", (*FIT, "--start", "{scene}", "--checkpoint", "{bad}", "--resume"), ("missing", "folder")),
    ("fit --settings", ".json", (*FIT, "--start", "{scene}", "--settings", "{bad}"), ()),
    ("render SCENE", ".ply", ("render", "{bad}", "--cameras", "orbit:1", "--images", "{out}/x", "--size", "16x16", *SMALL), ("scene",)),
    ("render --cameras", "", (*RENDER, "--cameras", "{bad}", "--images", "{out}/x"), ()),
    ("render --cameras path", "", (*RENDER, "--cameras", "path:{bad}:3", "--images", "{out}/x"), ()),
    ("render --compare", "", (*RENDER, "--cameras", "{object}", "--compare", "{bad}"), ()),
    ("convert SCENE", ".ply", ("convert", "{bad}", "--surfels-to-gaussians", "0.1", "--output", "{out}/s.ply"), ()),
    ("mesh SCENE", ".ply", ("mesh", "{bad}", "--output", "{out}/m.ply", "--voxels", "16", *SMALL), ("scene",)),
    ("mesh --cameras", "", ("mesh", "{scene}", "--output", "{out}/m.ply", "--voxels", "16", "--cameras", "{bad}", *SMALL), ()),
    ("info SCENE", ".ply", ("info", "{bad}", *SMALL), ("scene",)),
    ("init --encoder", ".safetensors", ("init", "micro", "--seed", "1", "--encoder", "{bad}", "--output", "{out}/m.safetensors"), ("model",)),
    ("weights info MODEL", ".safetensors", ("weights", "info", "{bad}"), ("model", "weights")),
    ("weights verify MODEL", ".safetensors", ("weights", "verify", "{bad}"), ("model",)),
    ("weights convert MODEL", ".safetensors", ("weights", "convert", "{bad}", "--dtype", "f16", "--output", "{out}/m.safetensors"), ("model",)),
    ("weights import FILE", ".ckpt", ("weights", "import", "{bad}", "--output", "{out}/m.safetensors"), ("weights",)),
    ("weights import --config", ".json", ("weights", "import", "{checkpoint}", "--output", "{out}/m.safetensors", "--config", "{bad}"), ()),
    ("kernels --model", ".safetensors", ("kernels", "--no-build", "--model", "{bad}", *SMALL), ("model",)),
    ("tune --model", ".safetensors", ("tune", "--quick", "--seconds", "1", "--model", "{bad}", "--output", "{out}/t.json"), ("model",)),
    ("tune --output", ".json", ("tune", "--quick", "--seconds", "1", "--model", "{model}", "--output", "{bad}"), ("missing",)),
    ("bench --compare", ".json", (*BENCH, "--compare", "{bad}"), ()),
    ("bench --scenes", "", ("bench", "render", "--seconds", "0.01", "--scenes", "{bad}", *SMALL), ()),
    ("bench --model", ".safetensors", ("bench", "train", "--seconds", "0.01", "--model", "{bad}", *SMALL), ("model",)),
    ("bench --cameras", ".json", ("bench", "train", "--seconds", "0.01", "--model", "{model}", "--cameras", "{bad}", *SMALL), ()),
    ("bench --selection", ".txt", ("bench", "train", "--seconds", "0.01", "--model", "{model}", "--selection", "{bad}", *SMALL), ("empty",)),
    ("profile diff BEFORE.json", ".json", ("profile", "diff", "{bad}", "{profile}"), ()),
    ("profile diff AFTER.json", ".json", ("profile", "diff", "{profile}", "{bad}"), ()),
    ("dataset render MESH", ".obj", ("dataset", "render", "{bad}", "--views", "1", "--size", "16", "--output", "{out}/set"), ()),
    ("dataset render --texture", ".png", ("dataset", "render", "{mesh}", "--texture", "{bad}", "--views", "1", "--size", "16", "--output", "{out}/set"),
     ("picture",)),
    ("dataset procedural --textures", "", ("dataset", "procedural", "--count", "1", "--views", "1", "--size", "16", "--textures", "{bad}", "--output",
                                            "{out}/set"), ()),
    ("dataset info DIR", "", ("dataset", "info", "{bad}"), ()),
    ("train CONFIG.json", ".json", ("train", "{bad}", "--data", "{set}", "--output", "{out}/run", *SMALL), ()),
    ("train --data", "", (*TRAIN, "--data", "{bad}"), ()),
    ("train --textures", "", ("train", "{procedural}", "--textures", "{bad}", "--output", "{out}/run", *SMALL), ()),
    ("train --init", ".safetensors", (*TRAIN, "--data", "{set}", "--init", "{bad}"), ("model",)),
    ("train --compare", "", ("train", "--compare", "{bad}", "--output", "{out}/c.html"), ()),
    ("train --selection", ".txt", (*TRAIN, "--data", "{set}", "--selection", "{bad}"), ("empty",)),
    ("train --output", "", ("train", "{config}", "--data", "{set}", "--output", "{bad}", "--resume", *SMALL), ("missing", "folder")),
    ("evaluate DIR", "", ("evaluate", "{bad}", "--model", "{model}", *SMALL), ()),
    ("evaluate --model", ".safetensors", ("evaluate", "{object}", "--model", "{bad}", *SMALL), ("model",)),
    ("evaluate --lpips", "", (*EVALUATE, "--lpips", "{bad}"), ()),
    ("evaluate --scenes", ".json", ("evaluate", "--scenes", "{bad}", "--output", "{out}/t.md", *SMALL), ()),
    ("evaluate --table", ".json", ("evaluate", "--table", "{bad}", "--output", "{out}/t.md", *SMALL), ()),
]

# (command and option, ending of the files or "/" for a folder, arguments with {bad})
WRITTEN = [
    ("reconstruct --output", ".ply", ("reconstruct", "{object}", "--model", "{model}", "--output", "{bad}", *SMALL)),
    ("reconstruct --output of --list", "/", ("reconstruct", "--list", "{list}", "--model", "{model}", "--output", "{bad}", *SMALL)),
    *((f"reconstruct {option}", ending, (*RECONSTRUCT, "--render", "orbit:1", "--size", "16x16", option, "{bad}", *more)) for option, ending, more in (
        ("--images", "/", ()), ("--sheet", ".png", ()), ("--turntable", ".webp", ()), ("--write-cameras", ".json", ("--images", "{out}/x")))),
    ("reconstruct --differences", "/", (*RECONSTRUCT, "--render", "{object}", "--compare", "{object}/images", "--differences", "{bad}")),
    ("reconstruct --refine-sheet", ".png", (*RECONSTRUCT, "--refine", "--refine-steps", "1", "--refine-sheet", "{bad}")),
    ("reconstruct --write-views", "/", (*RECONSTRUCT, "--write-views", "{bad}")),
    ("reconstruct --write-selection", ".txt", (*RECONSTRUCT, "--write-selection", "{bad}")),
    ("reconstruct --dump", "/", (*RECONSTRUCT, "--dump", "{bad}")),
    ("fit --output", ".ply", ("fit", "{object}", "--start", "{scene}", "--output", "{bad}", "--steps", "1", "--size", "16", *SMALL)),
    ("fit --sheet", ".png", (*FIT, "--start", "{scene}", "--sheet", "{bad}")),
    ("fit --log", ".csv", (*FIT, "--start", "{scene}", "--log", "{bad}")),
    ("fit --page", ".html", (*FIT, "--start", "{scene}", "--page", "{bad}")),
    ("fit --checkpoint", "/", (*FIT, "--start", "{scene}", "--checkpoint", "{bad}")),
    *((f"render {option}", ending, (*RENDER, "--cameras", "orbit:1", option, "{bad}", *more)) for option, ending, more in (
        ("--images", "/", ()), ("--sheet", ".png", ()), ("--turntable", ".webp", ()), ("--write-cameras", ".json", ("--images", "{out}/x")))),
    ("render --differences", "/", (*RENDER, "--cameras", "{object}", "--compare", "{object}/images", "--differences", "{bad}")),
    ("render --viewer", ".html", ("render", "{scene}", *SMALL, "--viewer", "{bad}")),
    ("reconstruct --viewer", ".html", (*RECONSTRUCT, "--viewer", "{bad}")),
    ("fit --viewer", ".html", (*FIT, "--start", "{scene}", "--viewer", "{bad}")),
    ("convert --output", ".ply", ("convert", "{surfels}", "--surfels-to-gaussians", "0.1", "--output", "{bad}")),
    ("init --output", ".safetensors", ("init", "micro", "--seed", "1", "--output", "{bad}")),
    ("convert --viewer", ".html", ("convert", "{scene}", "{out}/s.ply", "--viewer", "{bad}")),
    ("mesh --output", ".glb", ("mesh", "{scene}", "--voxels", "16", *SMALL, "--output", "{bad}")),
    ("info --picture", ".png", ("info", "{scene}", "--picture", "{bad}", *SMALL)),
    ("weights convert --output", ".safetensors", ("weights", "convert", "{model}", "--dtype", "f16", "--output", "{bad}")),
    ("weights import --output", ".safetensors", ("weights", "import", "{model}", "--output", "{bad}")),
    ("report --output", ".json", ("report", "--no-run", "--seconds", "20", "--output", "{bad}")),
    ("kernels --dump", "/", ("kernels", "--no-build", "--model", "{model}", "--dump", "{bad}", *SMALL)),
    ("tune --output", ".json", ("tune", "--quick", "--seconds", "1", "--model", "{model}", "--output", "{bad}")),
    ("dataset render --output", "/", ("dataset", "render", "{mesh}", "--views", "1", "--size", "16", "--output", "{bad}")),
    ("dataset procedural --output", "/", ("dataset", "procedural", "--count", "1", "--views", "1", "--size", "16", "--output", "{bad}")),
    ("dataset info --sheet", ".png", ("dataset", "info", "{set}", "--sheet", "{bad}")),
    ("train --output", "/", ("train", "{config}", "--data", "{set}", "--output", "{bad}", *SMALL)),
    ("train --output of --compare", ".html", ("train", "--compare", "{run}", "--output", "{bad}")),
    ("evaluate --sheet", ".png", (*EVALUATE, "--sheet", "{bad}")),
    ("evaluate --output", ".md", ("evaluate", "--table", "{table}", "--output", "{bad}", *SMALL)),
    *((f"{name} {option}", ".json", (*command, option, "{bad}")) for name, command in PROFILED.items() for option in ("--profile", "--trace")),
]


class BadFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = os.path.realpath(tempfile.mkdtemp(prefix="vsplat-bad-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, True)
        at = lambda *parts: os.path.join(cls.folder, "sound", *parts)
        rule.make_sound(at(), support.run, support.write_scene)
        with open(at("mesh.obj"), "w") as f:
            f.write("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n")
        pathlib.Path(at("list.txt")).write_text(at("set", "object") + "\n")
        pathlib.Path(at("procedural.json")).write_text('{"model": "micro", "steps": 1, "warmup": 1, "procedural": 1}')
        with open(at("table.json"), "w") as f:
            json.dump({"systems": [{"name": "micro", "model": at("micro.safetensors")}], "data": [{"name": "one", "folders": [at("set")]}],
                       "views": [{"name": "four", "inputs": 4}]}, f)
        with open(at("scene.ply"), "rb") as f:
            header, body = f.read().split(b"end_header\n")
        rows = [body[i:i + 56] for i in range(0, len(body), 56)]
        with open(at("surfels.ply"), "wb") as f:
            f.write(header.replace(b"property float scale_2\n", b"") + b"end_header\n" + b"".join(r[:36] + r[40:] for r in rows))
        code, _, err = support.run("render", at("scene.ply"), "--cameras", "orbit:1", "--size", "16x16", "--sheet", at("s.png"), "--profile", at("profile.json"))
        assert code == 0, err
        cls.sound = {"scene": at("scene.ply"), "surfels": at("surfels.ply"), "object": at("set", "object"), "set": at("set"), "model": at("micro.safetensors"),
                     "config": at("config.json"), "procedural": at("procedural.json"), "run": at("run"), "mesh": at("mesh.obj"), "list": at("list.txt"),
                     "profile": at("profile.json"), "table": at("table.json"),
                     "checkpoint": os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "golden", "lara_micro.ckpt")}

    def hold(self, tasks):
        """Runs tasks of (what, arguments without a value for {out}, the name to find, whether it may succeed); VSPLAT_BAD_FILES chooses some."""
        tasks = [task for task in tasks if os.environ.get("VSPLAT_BAD_FILES", "") in task[0]]

        def tries(number, task):
            what, arguments, name, may_succeed = task
            out = os.path.join(self.folder, f"out{number}")
            os.makedirs(out)
            code, _, err = support.run(*(a.replace("{out}", out) for a in arguments))
            left = os.listdir(out)
            shutil.rmtree(out)
            if code == 0 and may_succeed:
                return None
            said = re.search(r"(?ms)^vsplat: .*", err)  # the error, of several lines or one; not what came before
            if code not in (1, 2) or not said or name not in said.group():
                return f"{what}: ends with {code}: {err}"
            return f"{what}: leaves {left} behind" if left else None

        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            found = [line for line in pool.map(tries, range(len(tasks)), tasks) if line]
        self.assertFalse(found, f"{len(found)} of {len(tasks)}:\n" + "\n".join(found))

    def wrong(self, folder, ending):
        """Returns {kind: path}."""
        os.makedirs(folder)
        out = {}

        def make(kind, data):
            out[kind] = os.path.join(folder, f"bad_{kind}{ending}")
            if data is not None:
                pathlib.Path(out[kind]).write_bytes(data)

        def sound(name):
            return pathlib.Path(self.sound[name] if name in self.sound else os.path.join(self.folder, "sound", name)).read_bytes()

        make("missing", None)
        make("empty", b"")
        make("text", b"these are words\nand no file of ours\n")
        make("bytes", random.Random(1).randbytes(5000))
        make("json", b'{"a": 1}')
        make("picture", sound("s.png"))
        make("scene", sound("scene"))
        make("model", sound("model"))
        make("cut", sound({".ply": "scene", ".safetensors": "model", ".png": "s.png", ".json": "profile"}.get(ending, "model"))[:-20])
        make("folder", None)
        os.makedirs(out["folder"])
        make("dangling", None)
        os.symlink(os.path.join(folder, "nowhere"), out["dangling"])
        out["within"] = os.path.join(out["text"], f"bad_within{ending}")
        return out

    def read(self, chosen):
        tasks = []
        for number, (what, ending, arguments, right) in enumerate(READ):
            kinds = self.wrong(os.path.join(self.folder, f"read{number}"), ending)
            for kind in chosen(number, list(kinds)):
                given = [a.format(bad=kinds[kind], out="{out}", **self.sound) for a in arguments]
                tasks.append((f"{what} {kind}", given, f"bad_{kind}{ending}", kind in right))
        self.hold(tasks)

    def written(self, chosen):
        tasks = []
        for number, (what, ending, arguments) in enumerate(WRITTEN):
            folder, is_folder = os.path.join(self.folder, f"written{number}"), ending == "/"
            end = "" if is_folder else ending
            os.makedirs(folder)
            at = lambda name: os.path.join(folder, name)
            open(at("a_file"), "w").close()
            if is_folder:
                open(at("bad_kind"), "w").close()
            else:
                os.makedirs(at("bad_kind" + end))
            os.symlink(at("nowhere/at/all"), at("bad_link" + end))
            names = {"kind": "bad_kind" + end, "link": "bad_link" + end, "within": f"a_file/bad_within{end}", "long": "b" * 260 + end,
                     "proc": f"/proc/none/bad_proc{end}"}
            for kind in chosen(number, list(names)):
                given = [a.format(bad=os.path.join(folder, names[kind]), out="{out}", **self.sound) for a in arguments]
                looked_for = {"proc": "/proc/none", "within": "a_file"}.get(kind, names[kind])
                tasks.append((f"{what} {kind}", given, looked_for, False))
        self.hold(tasks)

    # Quick: each option with a missing file and two of the other kinds, in turn.
    def test_read(self):
        self.read(lambda number, kinds: [kinds[0], *(kinds[1 + (number * 2 + i) % (len(kinds) - 1)] for i in range(2))])

    def test_written(self):
        self.written(lambda number, kinds: [kinds[0], kinds[1 + number % (len(kinds) - 1)]])

    @support.slow
    def test_read_all(self):
        self.read(lambda number, kinds: kinds)

    @support.slow
    def test_written_all(self):
        self.written(lambda number, kinds: kinds)

    def test_all_are_tried(self):
        tried = {" ".join(what.split(" path")[0].split(" of ")[0].split()) for what, *_ in READ + WRITTEN}
        missing = []
        for command in COMMANDS:
            code, out, err = support.run(*command.split(), "--help")
            self.assertEqual(code, 0, err)
            for line in out.splitlines():
                if (m := LISTED.match(line)) and PLACES.search(m.group(2)):
                    name = f"{command} {m.group(1)}" if m.group(1).startswith("-") else f"{command} {m.group(2)}"
                    if name.rstrip(".") not in tried:
                        missing.append(name)
        self.assertFalse(missing, "options that take files and that no row tries")


if __name__ == "__main__":
    support.main()
