"""Every function of the C interface, as the headers declare it, called with mistakes that a caller may make: NULL for each argument, structs of
other sizes, a device that a job, another thread or the call itself is using; also after vsplat_device_cancel, and after everything that its
handles were made from was released. The expected statuses are those that the headers document:

  - NULL is valid for an argument if the function's comment says that it may be NULL, and for `options`; for any other argument it is
    VSPLAT_ERROR_USAGE, with a message that names the argument;
  - a struct size of 0 or 1, or one that ends within a field, is VSPLAT_ERROR_USAGE; a newer caller's larger struct works, and its additional
    bytes stay unchanged;
  - a call that ends with an error writes nothing through out_ pointers and no file, and launches no kernel;
  - a call that uses a device, or a handle made with one, ends with VSPLAT_ERROR_BUSY at once if another call is using it.

The tables below have the exceptions. -v prints the whole table: function, trial, status.
The trials run in a separate process, so that a crash is reported with the function's name and the others continue."""
import ctypes as c
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import unittest

from c_headers import Headers, Unknown
from functions_fixtures import WHOLE, Api, Files, Handles, Values

OK, USAGE, FILE, CANCELLED, BUSY = 0, 1, 2, 8, 10
BEYOND = 64  # additional bytes of a newer caller's struct
GUARD = 0xA5

# (function, parameter): statuses for NULL if the comment does not state them in the usual words.
NULL = {
    ("vsplat_model_load", "path"): (OK, FILE),  # the built-in model, if there is one
    ("vsplat_model_inspect", "path"): (OK, FILE),
    ("vsplat_model_verify", "path"): (OK, FILE),
    ("vsplat_train", "options"): (USAGE,),  # they state where to write
    ("vsplat_fit_create", "options"): (USAGE,),  # they state what to start from
    ("vsplat_scene_create", "arrays"): (USAGE,),  # "none may be"
    # For these the comment describes their fields.
    ("vsplat_render_backward", "gradient"): (USAGE,),
    ("vsplat_opencl_render_backward", "gradient"): (USAGE,),
    ("vsplat_opencl_render_backward", "out"): (USAGE,),
}
# Called with all arguments NULL or 0: functions for which that is valid.
ZERO = {"vsplat_option_names_set": (OK,), "vsplat_set_host_memory": (OK,), "vsplat_profile_begin": (OK,),
        "vsplat_get_host_memory": (OK,), "vsplat_file_rules_set": (OK,), "vsplat_model_inspect": (OK, FILE)}
# Only called with VSPLAT_FUNCTIONS=whole, as by the slow test functions_whole: (function, trial), and why.
DEAR = {("vsplat_mesh_write_views", "options NULL"): "by default 40 pictures of 512 x 512, eight seconds; tests/cli/dataset_test.py has them",
        ("vsplat_mesh_from_scene", "options NULL"): "by default a volume of 256 voxels along an edge; tests/cli/mesh_test.py has it",
        ("vsplat_selftest", "options NULL"): "a whole self-test; quick ones are in tests/cli/selftest_test.py",
        ("vsplat_tune", "options NULL"): "by default it searches for 50 seconds"}
# Run to their end only with VSPLAT_FUNCTIONS=whole; otherwise their progress function stops them.
ENDED = ("vsplat_selftest",)
# Parameters of the caller's own, which may always be NULL.
UNTRIED = ("user",)
# As the comment in vsplat.h says, these do not use the device; and jobs wait for other jobs.
WHILE_TAKEN = ("vsplat_device_retain", "vsplat_device_release", "vsplat_device_get_info", "vsplat_device_cancel", "vsplat_stream_create",
               "vsplat_opencl_get_handles", "vsplat_fit_retain", "vsplat_fit_release")
BEHIND_JOBS = ("vsplat_reconstruct_async", "vsplat_render_async")
TAKEN_BY = ("vsplat_device", "vsplat_fit")


def may_be_null(function, p):
    """Decides by the comment above the function: a sentence with the parameter and NULL, or out_ pointers of which either may be NULL."""
    if p.name in ("options", "job_options"):
        return True
    if p.name.startswith("out_") and re.search(r"\b[Ee]ither (out_ pointer )?may be NULL", function.comment):
        return True
    return any(f"`{p.name}`" in s and "NULL" in s for s in re.split(r"\.\s", function.comment))


def is_tried(p, headers):
    return p.name not in UNTRIED and (p.is_pointer or p.lengths or p.base in headers.handles or p.base in headers.prototypes)


def sized(p, headers):
    return p.stars == 1 and p.base in headers.structs and headers.structs[p.base]._fields_[0][0] == "size"


def cuts(struct):
    """Yields sizes that end within a field, one for each field: at a word's boundary if the field contains one, as for an older library."""
    for name, *_ in struct._fields_[1:]:
        field = getattr(struct, name)
        word = (field.offset // 8 + 1) * 8
        yield word if word < field.offset + field.size else field.offset + field.size // 2


def trials(function, headers):
    """Returns (trial, parameter or None, statuses), the same in both processes."""
    status = function.returns == "vsplat_status"
    tried = [p for p in function.parameters if is_tried(p, headers)]
    null = {p.name: NULL.get((function.name, p.name), (OK,) if may_be_null(function, p) else (USAGE,)) for p in tried}
    good = (CANCELLED,) if function.name in ENDED and not WHOLE else (OK,)
    out = [("as documented", None, good)]
    if function.parameters:
        refused = status and any(s == (USAGE,) for s in null.values())
        out.append(("all NULL or 0", None, ZERO.get(function.name, (USAGE,) if refused else (OK,))))
    for p in tried if status else ():
        out.append((f"{p.name} NULL", p, good if null[p.name] == (OK,) else null[p.name]))
        if sized(p, headers):
            out += [(f"{p.name} of size 0", p, (USAGE,)), (f"{p.name} of size 1", p, (USAGE,)), (f"{p.name} larger", p, good)]
            out += [(f"{p.name} of size {cut}", p, (USAGE,)) for cut in cuts(headers.structs[p.base])]
    takes = any(p.base in TAKEN_BY and not p.name.startswith("out_") for p in function.parameters)
    if takes:
        for by in ("a job", "a thread", "this call"):
            free = function.name in WHILE_TAKEN or function.name in BEHIND_JOBS and by == "a job"
            out.append((f"device held by {by}", by, (OK,) if free else (BUSY,)))
        out.append(("after a cancel", None, (OK,)))
    if any(p.base in headers.handles for p in function.parameters):
        out.append(("origins released", None, (OK,)))
    return [t for t in out if WHOLE or (function.name, t[0]) not in DEAR]


def functions(headers):
    """Returns the functions to call; with whole calls, only those that the quick test skips."""
    dear = {name for name, _ in DEAR} | {*ENDED}
    return [f for f in headers.functions.values() if not WHOLE or f.name in dear]


# ------------------------------------------------------------------------------------------------- the process of the trials


def memory_of(value):
    return (c.c_char * c.sizeof(value)).from_address(c.addressof(value))


def larger(value):
    """Returns the same structs as a caller with larger structs would pass them."""
    array = isinstance(value, c.Array)
    each = c.sizeof(value._type_ if array else value)
    count = len(value) if array else 1
    out = c.create_string_buffer(bytes([GUARD]) * (count * (each + BEYOND)), count * (each + BEYOND))
    for i in range(count):
        c.memmove(c.addressof(out) + i * (each + BEYOND), c.addressof(value) + i * each, each)
    c.c_size_t.from_buffer(out).value = each + BEYOND
    for i in range(1, count):
        c.c_size_t.from_buffer(out, i * (each + BEYOND)).value = each + BEYOND
    return out, each


class Worker:
    def __init__(self, folder):
        self.api = Api()
        self.headers, self.call = self.api.headers, self.api.functions
        self.files = Files(folder)
        self.tell("", "making what the test needs")
        self.own = Handles(self.api, self.files)
        self.files.make(self.api, self.own)
        self.values = Values(self.api, self.files, self.own)
        self.orphans, self.cancelled = None, []

    def tell(self, function, trial, **more):
        print(json.dumps({"function": function, "trial": trial, **more}), flush=True)

    def run(self, done):
        held = []
        for function in functions(self.headers):
            for trial, what, statuses in trials(function, self.headers):
                if f"{function.name} {trial}" in done:
                    continue
                if trial.startswith("device held"):
                    held.append((function, trial, what, statuses))
                else:
                    self.try_(function, trial, what, statuses)
        for by in ("a job", "a thread", "this call"):
            self.while_held(by, [h for h in held if h[2] == by])
        self.tell("", "done")

    def try_(self, function, trial, what, statuses):
        values = self.values
        if trial == "origins released":
            if self.orphans is None:
                self.tell("", "making what the test needs, origins released")
                self.orphans = Values(self.api, self.files, Handles(self.api, self.files, orphans=True))
                self.orphans.handles.orphan_device()
            values = self.orphans
        self.tell(function.name, trial, begins=1)
        arguments, folders = self.prepared(values, function, trial)
        if arguments is None:
            return
        if trial.startswith("all NULL"):
            arguments = [None if p.name in UNTRIED or is_tried(p, self.headers) else 0 for p in function.parameters]
        structs = {}
        for i, p in enumerate(function.parameters):
            if p is not what:
                continue
            if trial.endswith("NULL"):
                arguments[i] = None
            elif trial.endswith("larger"):
                arguments[i], structs[i] = larger(arguments[i])
            else:
                c.c_size_t.from_address(c.addressof(arguments[i])).value = int(trial.split()[-1])
        if trial == "after a cancel":
            self.api.call("vsplat_device_cancel", values.handles["vsplat_device"])
        self.one(function, trial, arguments, folders, statuses, structs, values)

    def prepared(self, values, function, trial):
        """Makes a function's arguments; reports one whose values are not known yet."""
        try:
            return values.of(function)
        except Unknown as e:
            self.tell(function.name, trial, status="not tried", problems=[str(e)], ms=0)
            return None, []

    def one(self, function, trial, arguments, folders, statuses, structs, values):
        """Makes a call, and checks what it must not have done."""
        problems = []
        outs = {p.name: a for p, a in zip(function.parameters, arguments) if p.name.startswith("out_") and a is not None}
        before = {name: bytes(memory_of(a)) for name, a in outs.items()}
        watched = statuses == (USAGE,) and values is not None and any(p.base in TAKEN_BY for p in function.parameters)
        if watched:
            self.launches(True)
        passed = [c.byref(a) if isinstance(a, (c.Structure, c.Array)) else a for a in arguments]
        began = time.monotonic()
        status = self.call[function.name](*passed)
        took = time.monotonic() - began
        if function.returns != "vsplat_status":
            self.tell(function.name, trial, status="-" if function.returns == "void" else str(status), problems=[], ms=round(1000 * took))
            return
        sentence = self.api.last_error()
        if status not in statuses:
            problems.append(f"{self.api.status(status)}{': ' + sentence if status else ''}; expected {' or '.join(map(self.api.status, statuses))}")
        elif status:
            about = re.sub(r" (NULL|of size \d+)$", "", trial)
            if not sentence:
                problems.append("vsplat_last_error() is empty")
            elif trial.endswith("NULL") and status != CANCELLED and about not in sentence:
                problems.append(f"the sentence names no {about}: {sentence}")
            elif " of size " in trial and "size" not in sentence:
                problems.append(f"the sentence tells no size: {sentence}")
            problems += [f"{name} was written though it failed" for name, a in outs.items() if bytes(memory_of(a)) != before[name]]
            if any(map(os.listdir, folders)):
                problems.append("a file was written though it failed")
        if status == BUSY and took > 1:
            problems.append(f"took {took:.1f} s to find the device taken")
        if watched and (launched := self.launches(False)):
            problems.append(f"launched {', '.join(launched)} though it was refused")
        for i, each in structs.items():
            whole = bytes(memory_of(arguments[i]))
            at = range(0, len(whole) - BEYOND, each + BEYOND)
            if any(whole[a + each:a + each + BEYOND] != bytes([GUARD]) * BEYOND or int.from_bytes(whole[a:a + 8], sys.byteorder) != each + BEYOND
                   for a in at):
                problems.append(f"{function.parameters[i].name}'s size, or what is beyond the library's own fields, was written")
        self.tell(function.name, trial, status=self.api.status(status), problems=problems, ms=round(1000 * took))
        if status == OK:
            self.drop(function, arguments, wait=not trial.startswith("device held"))

    def drop(self, function, arguments, wait):
        """Releases what a call has made."""
        for p, a in zip(function.parameters, arguments):
            if a is None or not p.name.startswith("out_"):
                continue
            made = c.c_void_p.from_address(c.addressof(a)).value
            if p.base in self.headers.handles:
                if p.base == "vsplat_job":
                    self.own.alive.append(arguments)
                    if not wait:
                        self.api.call("vsplat_job_cancel", made)
                        self.cancelled.append(made)
                        continue
                    self.ended(made)
                if made != 0x5a5a5a5a5a5a5a5a:
                    self.call[f"{p.base}_release"](made)
            elif p.base == "char" and p.stars == 2:
                self.call["vsplat_text_free"](made)

    def ended(self, job):
        self.api.call("vsplat_job_wait", job, -1.0, c.byref(c.c_int()))

    def launches(self, begin):
        device = self.own["vsplat_device"]
        if begin:
            self.api.call("vsplat_device_profile", device, 1)
            return []
        text = c.c_void_p()
        self.api.call("vsplat_device_profile_text", device, 1, c.byref(text))
        out = [k["name"] for k in json.loads(c.string_at(text.value))["kernels"]]
        self.call["vsplat_text_free"](text)
        self.api.call("vsplat_device_profile", device, 0)
        return out

    def while_held(self, by, held):
        """A reconstruction uses the device until its progress function returns."""
        if not held:
            return
        self.tell("", f"making what the test needs, held by {by}")
        prepared = [(function, trial, *self.prepared(self.values, function, trial), statuses) for function, trial, _, statuses in held]
        prepared = [each for each in prepared if each[2] is not None]
        prepared.sort(key=lambda h: h[0].name == "vsplat_device_cancel")  # it stops the call that is using the device
        began, over, failed = threading.Event(), threading.Event(), []

        def all_trials():
            for function, trial, arguments, folders, statuses in prepared:
                self.tell(function.name, trial, begins=1)
                self.one(function, trial, arguments, folders, statuses, {}, None)

        def progress(user, stage, done):
            if not began.is_set():
                began.set()
                if by != "this call":
                    over.wait()
                else:
                    try:
                        all_trials()
                    except Exception:  # ctypes would swallow it
                        failed.append(traceback.format_exc())
            return 1

        result = self.headers.prototypes["vsplat_progress_function"](progress)
        options = self.own.reconstruction(progress=c.cast(result, c.c_void_p).value)
        arguments = [self.own[k] for k in ("vsplat_device", "vsplat_model", "vsplat_input")] + [c.byref(options)]
        cancelled = any(function.name == "vsplat_device_cancel" for function, *_ in prepared)
        out = c.c_void_p()
        if by == "a job":
            job = self.api.made("vsplat_reconstruct_async", *arguments, None)
            began.wait()
            all_trials()
            over.set()
            self.ended(job)
            status = self.call["vsplat_job_result"](job, None)
            self.call["vsplat_job_release"](job)
        else:
            end = []
            thread = threading.Thread(target=lambda: end.append(self.call["vsplat_reconstruct"](*arguments, c.byref(out))))
            thread.start()
            if by == "a thread":
                began.wait()
                all_trials()
                over.set()
            thread.join()
            status = end[0]
            if status == OK:
                self.call["vsplat_scene_release"](out)
        for job in self.cancelled:  # jobs that may still be using the device
            self.ended(job)
            self.call["vsplat_job_release"](job)
        self.cancelled.clear()
        if failed:
            raise RuntimeError(failed[0])
        if cancelled and status != CANCELLED:
            self.tell("vsplat_device_cancel", f"device held by {by}, which ends", status=self.api.status(status), ms=0,
                      problems=[f"the call that had the device ended with {self.api.status(status)}; expected cancelled"])


# ----------------------------------------------------------------------------------------------------------- the test


class Functions(unittest.TestCase):
    maxDiff = None
    SECONDS = 1200 if WHOLE else 240  # limit for a process; a longer run counts as hanging

    def setUp(self):
        """Self-tests and searches store their results in the test's own cache, so that other programs are not affected."""
        cache = tempfile.TemporaryDirectory(prefix="vsplat-cache-")
        self.addCleanup(cache.cleanup)
        self.environment = {**os.environ, "VSPLAT_CACHE_DIR": cache.name}

    def worker(self, done):
        """Returns the results, or None if the process ended early."""
        with tempfile.TemporaryDirectory(prefix="vsplat-functions-") as folder, tempfile.TemporaryFile("w+") as errors:
            process = subprocess.Popen([sys.executable, __file__, "--worker", folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                       stderr=errors, text=True, env=self.environment)
            process.stdin.write("\n".join(done))
            process.stdin.close()
            timer = threading.Timer(self.SECONDS, process.kill)
            timer.start()
            results, at = [], ("", "the start")
            for line in process.stdout:
                result = json.loads(line)
                at = (result["function"], result["trial"])
                if "status" in result:
                    results.append(result)
            code = process.wait()
            process.stdout.close()
            timer.cancel()
            errors.seek(0)
            return results, None if code == 0 and at[1] == "done" else (*at, code, errors.read()[-2000:])

    def test_each_as_documented(self):
        headers = Headers()
        self.assertGreater(len(headers.functions), 100)
        expected = {f"{f.name} {trial}" for f in functions(headers) for trial, *_ in trials(f, headers)}
        results, problems = [], []
        for _ in range(9):
            more, end = self.worker([f"{r['function']} {r['trial']}" for r in results])
            results += more
            if end is None:
                break
            function, trial, code, errors = end
            problems.append(f"{function or 'the test'}, {trial}: the process ended with {code}\n{errors}")
            if not function:
                break
            results.append({"function": function, "trial": trial, "status": f"ended with {code}", "problems": [], "ms": 0})
        problems += [f"{r['function']}, {r['trial']}: {p}" for r in results for p in r["problems"]]
        if "-v" in sys.argv:
            for r in sorted(results, key=lambda r: r["function"]):
                print(f"{r['function']:<40} {r['trial']:<32} {r['status']:<10} {r['ms']:>6} ms", file=sys.stderr)
        result = {f"{r['function']} {r['trial']}" for r in results}
        if not problems:
            self.assertEqual(sorted(expected - result), [], "not tried")
        self.assertFalse(problems, "\n" + "\n".join(problems))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        Worker(sys.argv[2]).run(set(sys.stdin.read().split("\n")))
    else:
        unittest.main()
