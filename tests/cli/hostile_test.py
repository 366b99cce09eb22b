"""Every command with every kind of malicious file. tests/hostile makes the files from a seed, and has the rule that commands must obey.

  VSPLAT=... hostile_test.py [Hostile|Traced]   the quick files of one seed
  VSPLAT_HOSTILE_SEEDS=1,2,3 ...                all files of these seeds
  VSPLAT_HOSTILE_ALL=1 ...                      with every command that accepts a file; otherwise commands that need a device take turns
  VSPLAT_HOSTILE=DIR ...                        a folder of finds instead: files by their endings, folders by their list of cameras
  VSPLAT_HOSTILE_KINDS=gltf/*,png/*:train ...   only these kinds, or one command with them"""
import concurrent.futures
import fnmatch
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import support

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "hostile"))
import make_hostile  # noqa: E402
import rule  # noqa: E402

# Fast commands that need no device get every file; of the others, each file gets one in turn (VSPLAT_HOSTILE_ALL=1: all).
CHEAP = ("print", "info", "verify", "convert", "init", "import", "view")
QUICK_EVERY = 10  # the quick test uses one file in so many


def chosen(kind, command):
    only = os.environ.get("VSPLAT_HOSTILE_KINDS", "*")
    return any(fnmatch.fnmatchcase(kind, pattern) or fnmatch.fnmatchcase(f"{kind}:{command}", pattern) for pattern in only.split(","))


def listed(folder, sound, scratch):
    """A folder of finds: the kind of each file, by its ending."""
    by_ending = {".json": "config", ".safetensors": "model", ".h5": "hdf5", ".hdf5": "hdf5", ".txt": "selection", ".ckpt": "checkpoint"}
    for ending in (".obj", ".ply", ".stl", ".gltf", ".glb", ".3mf", ".off", ".ase", ".md5mesh", ".dae", ".fbx"):
        by_ending[ending] = "mesh"
    out = []
    def add(path, role, kind=None):
        relative = os.path.relpath(path, folder)
        out.append({"kind": kind or relative, "role": role, "path": relative, "names": os.path.basename(path)})
    for root, folders, files in os.walk(folder):
        if "transforms.json" in files:
            folders[:] = []
            add(root, "views")
            if "images" in os.listdir(root):
                add(root, "compare")
            continue
        for name in sorted(files):
            path, ending = os.path.join(root, name), os.path.splitext(name)[1].lower()
            if ending in by_ending:
                add(path, by_ending[ending])
            if ending == ".ply":
                add(path, "scene")
            if ending in (".png", ".jpg", ".exr", ".tif", ".webp", ".bmp"):  # only as the first of an object's pictures
                copy = os.path.join(scratch, f"picture{len(out)}")
                shutil.copytree(os.path.join(sound, "set", "object"), copy)
                shutil.copy(path, os.path.join(copy, "images", "first" + ending))
                with open(os.path.join(copy, "transforms.json")) as f:
                    text = f.read()
                with open(os.path.join(copy, "transforms.json"), "w") as f:
                    f.write(re.sub(r'"(w|h|fl_x|fl_y|cx|cy)": [^,]*,', "", text).replace("images/0000.png", "images/first" + ending, 1).replace("{", '{"camera_angle_x": 0.8,', 1))
                out.append({"kind": os.path.relpath(path, folder), "role": "views", "path": os.path.relpath(copy, folder), "names": "first" + ending})
    return out


class Case(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = os.path.realpath(tempfile.mkdtemp(prefix="vsplat-hostile-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, True)
        cls.sound = os.path.join(cls.folder, "sound")
        rule.make_sound(cls.sound, support.run, support.write_scene)

    def made(self, seed):
        folder = os.path.join(self.folder, f"seed{seed}")
        return folder, make_hostile.make(seed, folder, self.sound)

    def hold(self, folder, tasks, **how):
        """tasks: (entry, command). Runs all of them; none may violate the rule or change a file."""
        before, found, most = rule.content_of(self.folder), [], (0, 0)
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            for lines, ran in pool.map(lambda task: rule.check(*task, folder, self.sound, **how), tasks):
                print(*lines, sep="\n", end="\n" if lines else "", file=sys.stderr, flush=True)  # before the end, which may be far away
                found += lines
                most = max(most[0], ran.seconds), max(most[1], ran.bytes)
        print(f"{len(tasks)} commands, the longest {most[0]:.1f} s, the largest {most[1] / 2**30:.2f} GiB", file=sys.stderr)
        self.assertEqual(before, rule.content_of(self.folder), "files changed")
        self.assertFalse(found, f"{len(found)} violations:\n" + "\n".join(found))


class Hostile(Case):
    def test_the_rule(self):
        if given := os.environ.get("VSPLAT_HOSTILE"):
            finds = os.path.realpath(given)
            return self.hold(finds, self.tasks(finds, listed(finds, self.sound, self.folder)))
        seeds = os.environ.get("VSPLAT_HOSTILE_SEEDS", "")
        for seed in seeds.split(",") if seeds else ["1"]:
            with self.subTest(seed=seed):
                folder, made = self.made(int(seed))
                tasks = self.tasks(folder, made, int(seed))
                self.hold(folder, tasks if seeds else tasks[::QUICK_EVERY])

    def tasks(self, folder, made, turn=0):
        out = []
        for i, entry in enumerate(made):
            names = [name for name, _ in rule.commands(entry["role"], "", "", "")]
            others = [name for name in names if name not in CHEAP and entry["role"] != "mesh"]
            one = others[(i + turn) % max(1, len(others)):][:1]
            names = [name for name in names if name not in others or name in one or os.environ.get("VSPLAT_HOSTILE_ALL")]
            out += [(entry, name) for name in names if chosen(entry["kind"], name)]
        return out


# Files that every program on this system opens, or may open.
SYSTEM = ("/usr/", "/lib/", "/lib64/", "/bin/", "/etc/ld.so.", "/etc/OpenCL/", "/etc/nsswitch.conf", "/etc/localtime", "/etc/drirc", "/proc/", "/sys/", "/dev/null",
          "/dev/urandom", "/dev/random", "/dev/dri", "/dev/shm")
OPENS = re.compile(r'^(open|openat|openat2|creat)\((?:(AT_FDCWD|\d+)(?:<([^>]*)>)?, )?"((?:[^"\\]|\\.)*)"(.*) = (-?\d+)')
CHANGES = re.compile(r"^(rename|renameat|renameat2|unlink|unlinkat|mkdir|mkdirat|rmdir|link|linkat|symlink|symlinkat|truncate|chmod|fchmodat|chown|mknod|mknodat|utimensat)\((.*)\) = 0")


def traces_work():
    strace = shutil.which("strace")
    return strace and subprocess.run([strace, "-qq", "-o", os.devnull, "true"], capture_output=True).returncode == 0


class Traced(Case):
    """The files that are opened, as the kernel sees it."""
    KINDS = ("outside/*", "obj/mtllib*", "obj/map*", "gltf/buffer*", "gltf/texture*", "ply/texture", "hdf5/stored*", "hdf5/link*", "hdf5/group*", "hdf5/virtual*", "hdf5/soft*",
             "colmap/outside*", "colmap/case*", "paths/*", "compare/*", "textures/*", "names/*", "model/escape_name", "config/nested",
             "checkpoint/name*", "checkpoint/key*", "checkpoint/only_outside", "checkpoint/*_dict")

    @classmethod
    def setUpClass(cls):
        if not traces_work():
            raise unittest.SkipTest("strace is not installed, or may not trace")
        super().setUpClass()

    def opened(self, log):
        for name in os.listdir(log):
            with open(os.path.join(log, name), errors="backslashreplace") as f:
                for line in f:
                    if (m := OPENS.match(line)) and int(m.group(6)) >= 0:
                        base = os.getcwd() if m.group(2) in (None, "AT_FDCWD") else m.group(3) or "/"
                        written = m.group(4).encode().decode("unicode_escape").encode("latin-1").decode("utf-8", "surrogateescape")
                        yield ("list:" if "O_DIRECTORY" in m.group(5) else "") + os.path.realpath(os.path.join(base, written))
                    elif m := CHANGES.match(line):
                        yield from ("change:" + os.path.realpath(path) for path in re.findall(r'"(/[^"]*)"', m.group(2)))

    def test_nothing_outside_is_opened(self):
        folder, made = self.made(1)
        build = os.path.dirname(os.path.dirname(os.path.realpath(rule.VSPLAT)))
        caches = os.path.join(self.folder, "caches")
        os.makedirs(caches)
        env = {name: caches for name in ("POCL_CACHE_DIR", "XDG_CACHE_HOME", "VSPLAT_CACHE_DIR", "TMPDIR")}
        if rule.SANITIZED:  # the leak search traces the process, which only one tracer may do
            env["ASAN_OPTIONS"] = os.environ["ASAN_OPTIONS"] + ":detect_leaks=0"
        log = os.path.join(self.folder, "log")
        def run(entry, command, more=()):
            shutil.rmtree(log, True)
            os.makedirs(log)
            def look(given, out):
                home = given if os.path.isdir(given) else os.path.dirname(given)
                inside = [os.path.realpath(p) + "/" for p in (home, out, caches, self.sound, build, log)]
                # The pictures of a COLMAP model may be in up to three folders above it.
                above = [os.path.realpath(os.path.join(home, *[".."] * i)) for i in (1, 2, 3)] if entry["kind"].startswith("colmap/") else []
                found = []
                for path in self.opened(log):
                    place = re.sub("^(change|list):", "", path) + "/"
                    allowed = inside[1:3] if path.startswith("change:") else inside
                    if path.startswith("list:") and place[:-1] in above:
                        continue
                    if not any(place.startswith(p) for p in allowed) and (path.startswith("change:") or not place.startswith(SYSTEM)) and path not in more:
                        found.append(f"opens {path}")
                return sorted(set(found))
            return rule.check(entry, command, folder, self.sound, env=env, look=look,
                              prefix=("strace", "-ff", "-qq", "-y", "-s", "4096", "-e", "trace=%file", "-e", "signal=none", "-o", os.path.join(log, "t")))
        tasks = [(entry, name) for entry in made for name, _ in rule.commands(entry["role"], "", "", "")[:2]
                 if any(fnmatch.fnmatchcase(entry["kind"], kind) for kind in self.KINDS) and chosen(entry["kind"], name)]
        # Files that a sound input opens may be opened for any input: they belong to a driver.
        usual = set()
        for role, path in (("views", "set/object"), ("model", "micro.safetensors"), ("scene", "scene.ply")):
            for name, _ in rule.commands(role, "", "", "")[:2]:
                entry = {"kind": "sound", "role": role, "path": os.path.join(self.sound, path), "names": path}
                run(entry, name)
                usual.update(self.opened(log))
        self.assertTrue(any(path.startswith(self.sound) for path in usual), "the trace shows what is read")
        self.assertTrue(any(path.startswith("list:" + self.sound) for path in usual), "and what is listed")
        found = [line for task in tasks for line in run(*task, usual - {"/dev/zero"})[0]]
        self.assertFalse(found, f"{len(found)} violations:\n" + "\n".join(found))


if __name__ == "__main__":
    support.main()
