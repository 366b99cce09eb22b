"""The rule for untrusted files, and the commands that read them.

A command ends within 20 s of processor time and 1.5 GiB of memory, with exit status 0, 1 or 2. If it fails, stderr names the file. No control
character reaches the terminal. Nothing is left behind, nothing else is changed, and nothing outside of the given folders is opened."""
import json
import math
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import tempfile
import time
import unicodedata

VSPLAT = os.environ.get("VSPLAT", "vsplat")
SANITIZED = "ASAN_OPTIONS" in os.environ  # a build that checks every memory access
SECONDS = 20 * (6 if SANITIZED else 1)
BYTES = int((1.5 if not SANITIZED else 5) * 2**30)
# The wall-clock limit only ends commands that wait forever, since wall time depends on how busy the machine is.
PATIENCE = 6 * SECONDS
KEPT = "sound"

EXPENSIVE = ("--max-memory", "0.5")

# Invisible characters that change how others look: marks of direction and order, joiners, tags.
UNSEEN = "\u00ad\u061c\u200b\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2060\u2066\u2067\u2068\u2069\ufeff\U000e0041"


def commands(role, path, sound, out):
    """Yields name and arguments of the commands that accept the file; `out` is an empty folder."""
    at = lambda *parts: os.path.join(sound, *parts)
    to = lambda *parts: os.path.join(out, *parts)
    objects, model, scene, config = at("set", "object"), at("micro.safetensors"), at("scene.ply"), at("config.json")
    reconstruct = ("reconstruct", objects, "--output", to("s.ply"), *EXPENSIVE)
    if role == "config":
        return [("print", ("train", path, "--print-config")), ("dry_run", ("train", path, "--dry-run"))]
    if role == "model":
        return [("info", ("weights", "info", path)), ("verify", ("weights", "verify", path)),
                ("convert", ("weights", "convert", path, "--dtype", "f16", "--output", to("m.safetensors"))),
                ("reconstruct", (*reconstruct, "--model", path)), ("evaluate", ("evaluate", objects, "--model", path, *EXPENSIVE)),
                ("train", ("train", config, "--data", at("set"), "--init", path, "--output", to("run"), *EXPENSIVE)),
                ("fit", ("fit", objects, "--start", "network", "--model", path, "--steps", "1", "--output", to("s.ply"), *EXPENSIVE))]
    if role == "views":
        return [("info", ("dataset", "info", path)),
                ("reconstruct", ("reconstruct", path, "--model", model, "--views", "@0,@1", "--output", to("s.ply"), "--verbose", *EXPENSIVE)),
                ("fit", ("fit", path, "--start", scene, "--steps", "1", "--size", "16", "--output", to("s.ply"), *EXPENSIVE)),
                ("evaluate", ("evaluate", path, "--model", model, *EXPENSIVE)),
                ("train", ("train", config, "--data", path, "--output", to("run"), *EXPENSIVE)),
                ("render", ("render", scene, "--cameras", path, "--size", "16x16", "--images", to("x"), *EXPENSIVE))]
    if role == "mesh":
        return [("render", ("dataset", "render", path, "--views", "1", "--size", "16", "--output", to("set")))]
    if role == "hdf5":
        return [("info", ("dataset", "info", path)), ("evaluate", ("evaluate", path, "--model", model, *EXPENSIVE)),
                ("train", ("train", config, "--data", path, "--output", to("run"), *EXPENSIVE))]
    if role == "compare":
        return [("compare", ("render", scene, "--cameras", objects, "--compare", os.path.join(path, "images"), *EXPENSIVE))]
    if role == "selection":
        return [("plan", ("train", config, "--dry-run", "--selection", path)), ("reconstruct", (*reconstruct, "--model", model, "--selection", path))]
    if role == "scene":
        return [("render", ("render", path, "--cameras", "orbit:1", "--size", "16x16", "--images", to("x"), *EXPENSIVE)),
                ("skip", ("render", path, "--skip-bad", "--cameras", "orbit:1", "--size", "16x16", "--images", to("x"), *EXPENSIVE)),
                ("show", ("info", path, *EXPENSIVE)),
                ("view", ("view", path, "--no-open", "--output", to("s.html"))),
                ("convert", ("convert", path, "--skip-bad", "--remove-floaters", "--to", "RUF", to("s.ply"))),
                ("fit", ("fit", objects, "--start", path, "--steps", "1", "--size", "16", "--output", to("s.ply"), *EXPENSIVE))]
    if role == "run":
        return [("resume", ("train", config, "--data", at("set"), "--resume", "--output", to("given"), *EXPENSIVE))]
    if role == "state":
        return [("resume", ("fit", objects, "--start", scene, "--steps", "3", "--size", "16", "--checkpoint", to("given"), "--resume", "--output", to("s.ply"), *EXPENSIVE))]
    if role == "textures":
        return [("procedural", ("dataset", "procedural", "--count", "1", "--views", "1", "--size", "16", "--textures", path, "--output", to("set")))]
    if role == "lpips":
        return [("evaluate", ("evaluate", objects, "--model", model, "--lpips", path, *EXPENSIVE))]
    if role == "checkpoint":
        return [("import", ("weights", "import", path, "--output", to("m.safetensors")))]
    if role == "encoder":
        return [("init", ("init", "micro", "--seed", "1", "--encoder", path, "--output", to("m.safetensors")))]
    raise ValueError(role)


def make_sound(folder, run, write_scene):
    """Sound files, made by the command itself."""
    at = lambda *parts: os.path.join(folder, *parts)
    os.makedirs(folder)
    def done(*arguments):
        code, _, err = run(*arguments)
        assert code == 0, err
    done("init", "micro", "--seed", 3, "--output", at("micro.safetensors"))
    for name, size in (("lara", "micro"), ("genden", "micro"), ("vsplat+genden", "tiny")):
        done("init", size, "--system", name, "--seed", 3, "--output", at(f"{name}.safetensors"))
    done("dataset", "procedural", "--solids", "--count", 1, "--views", 6, "--size", 16, "--seed", 3, "--output", at("set"))
    os.rename(at("set", "solid_0000"), at("set", "object"))
    with open(at("config.json"), "w") as f:
        json.dump({"model": "micro", "steps": 2, "warmup": 1, "log_every": 1, "sheet_every": 0, "checkpoint_every": 1}, f)
    done("train", at("config.json"), "--data", at("set"), "--output", at("run"))
    write_scene(at("scene.ply"), [((0.1 * i - 0.3, 0, 0), (i / 6, 1, 0), 0.08, 0.8) for i in range(7)])
    done("fit", at("set", "object"), "--start", at("scene.ply"), "--steps", 3, "--size", 16, "--checkpoint", at("state"), "--output", at("refined.ply"))
    os.remove(at("refined.ply"))


def content_of(folder):
    """Returns the folder's content by name: size and time of each file."""
    out = {}
    for root, folders, files in os.walk(folder):
        for name in folders + files:
            path = os.path.join(root, name)
            what = os.lstat(path)
            out[os.path.relpath(path, folder)] = (what.st_mode, what.st_size if not os.path.isdir(path) else 0, what.st_mtime_ns if not os.path.isdir(path) else 0)
    return out


def processes_of(pid):
    """A process and its descendants."""
    found = [pid]
    for process in found:
        try:
            for task in os.listdir(f"/proc/{process}/task"):
                with open(f"/proc/{process}/task/{task}/children") as f:
                    found += [int(child) for child in f.read().split()]
        except OSError:
            pass
    return found


def use_of(pid):
    """Returns seconds of processor time and resident bytes of a process and its descendants."""
    ticks, pages = 0, 0
    for process in processes_of(pid):
        try:
            with open(f"/proc/{process}/stat") as f:
                fields = f.read().rpartition(")")[2].split()
            ticks += int(fields[11]) + int(fields[12]) + (int(fields[13]) + int(fields[14]) if process == pid else 0)
            pages += int(fields[21])
        except (OSError, IndexError):
            pass
    return ticks / os.sysconf("SC_CLK_TCK"), pages * resource.getpagesize()


def unusable(path):
    """Returns what is wrong with a written scene: values that are not numbers."""
    with open(path, "rb") as f:
        head, _, body = f.read().partition(b"end_header\n")
    values = struct.unpack(f"<{len(body) // 4}f", body[:len(body) // 4 * 4])
    bad = sum(not math.isfinite(v) for v in values)
    return [f"writes {bad} values that are no numbers"] if bad or b"binary_little_endian" not in head else []


class Ran:
    """A finished command: its status (below 0: a signal), output and cost, and why it was killed, if it was."""
    def __init__(self, command, env=None):
        self.ended, self.bytes, begun = "", 0, time.monotonic()
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True, env={**os.environ, **(env or {})})
            pause = 0.005
            while True:
                pid, status, use = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    break
                seconds, resident = use_of(process.pid)
                self.bytes = max(self.bytes, resident)
                waited = time.monotonic() - begun
                if not self.ended and (seconds > SECONDS or resident > BYTES or waited > PATIENCE):
                    self.ended = f"{seconds:.1f} s of processor, {waited:.1f} s waited for, {resident / 2**30:.2f} GiB resident"
                    os.killpg(process.pid, signal.SIGKILL)
                time.sleep(pause)
                pause = min(0.03, pause * 1.2)
            process.returncode = self.status = os.waitstatus_to_exitcode(status)
            self.seconds, self.waited = use.ru_utime + use.ru_stime, time.monotonic() - begun
            self.bytes = max(self.bytes, use.ru_maxrss * 1024)
            self.out, self.err = (self.text(f) for f in (out, err))

    @staticmethod
    def text(file):
        file.seek(0)
        return file.read(4 << 20).decode("utf-8", "backslashreplace")


def shown(command):
    return " ".join(word if re.fullmatch(r"[\w@%+=:,./-]+", word) else "'" + word.replace("'", "'\\''") + "'" for word in command)


def is_named(ran, made, given, out):
    """Whether an error names its subject: the file, one beside it, an output, a view of the given list, or an object of the given folder; or
    says that the memory that the test allows is not enough."""
    folder = given if os.path.isdir(given) else os.path.dirname(given)
    words = [given, folder + "/", made["names"], out + "/", "--max-memory"]
    words += {"model": ["vsplat: step "], "views": ["view 0 (", "object " + os.path.basename(given)]}.get(made["role"], [])
    return any(word in text for word in words for text in (ran.err, ran.out))


def violations(ran, made, given, out_folder, left):
    """Returns violations of the rule. left: new or changed files in the output's folder."""
    out = []
    if ran.ended:
        return ["was ended: " + ran.ended]
    if ran.status not in (0, 1, 2):
        out.append(f"exit status {ran.status}" + (f" ({signal.Signals(-ran.status).name})" if ran.status < 0 else ""))
    if ran.seconds > SECONDS:
        out.append(f"{ran.seconds:.1f} s of processor")
    if ran.bytes > BYTES:
        out.append(f"{ran.bytes / 2**30:.2f} GiB")
    if ran.status != 0 and not is_named(ran, made, given, out_folder):
        out.append(f"does not name {made['names']}")
    if ran.status != 0 and not ran.err.strip():
        out.append("nothing on stderr")
    for what, text in (("stdout", ran.out), ("stderr", ran.err)):
        raw = sorted({f"{ord(c):#04x}" for c in text if c not in "\n\t" and (unicodedata.category(c) in ("Cc", "Zl", "Zp") or c in UNSEEN)})
        if raw:
            out.append(f"{what} holds {', '.join(raw)}")
        if any(len(line) > 20_000 for line in text.split("\n")):
            out.append(f"{what} has a line of {max(map(len, text.split(chr(10))))} characters")
    for word in ("terminate called", "Sanitizer", "runtime error:", "std::bad_alloc", "Assertion"):
        if word in ran.err:
            out.append(f"stderr says {word}")
    # A training continues from its last checkpoint, whatever ended it.
    if ran.status != 0 and left and not any("checkpoint-" in name for name in left):
        out.append("leaves " + ", ".join(sorted(left)[:4]))
    return out


def check(made, command, folder, sound, env=None, prefix=(), look=None):
    """Runs one of an entry's commands in an empty folder. Returns violations, as lines that begin with the command, and the finished command.
    look(given, out): returns more violations, called when the command has ended."""
    path = os.path.join(folder, made["path"])
    out = tempfile.mkdtemp(prefix="vsplat-hostile-")
    try:
        if made["role"] in ("run", "state"):
            shutil.copytree(path, os.path.join(out, "given"))
        name, arguments = next(c for c in commands(made["role"], path, sound, out) if c[0] == command)
        line = [VSPLAT, *arguments]
        before = content_of(out)
        ran = Ran([*prefix, *line], env)
        left = {name for name, what in content_of(out).items() if before.get(name) != what}
        given = os.path.join(out, "given") if made["role"] in ("run", "state") else path
        found = violations(ran, made, given, out, left) + (look(path, out) if look else [])
        if os.path.exists(os.path.join(out, "s.ply")):
            found += unusable(os.path.join(out, "s.ply"))
        return [f"{made['kind']}, {name}: {what}\n    {shown(line)}\n    {ran.err.strip()[-300:]!r}" for what in found], ran
    finally:
        shutil.rmtree(out, True)
