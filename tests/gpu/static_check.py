#!/usr/bin/env python3
"""Compiles the kernels with the compilers of GPU drivers, without a GPU: nothing may spill or keep scratch memory.

    static_check.py DUMP... [--targets amd:gfx90a,intel:dg2,...] [--only TEXT] [--json FILE] [--cache DIR] [--jobs N]
                    [--table FILE] [--baseline FILE [--anew]] [--ptxas PROGRAM]

DUMP is a folder written by `vsplat kernels --dump`; equal programs of several folders are compiled once. Prints for each kernel and target:
registers, bytes spilled, bytes of private memory (scratch: arrays that did not stay in registers), bytes of local memory, waves that fit
into a SIMD (AMD), warps that fit into a multiprocessor by their registers (NVIDIA) or the SIMD width (Intel), and the share of multiply-adds
among the main loop's instructions.

Exits with 1 if a kernel does not compile; if it spills or keeps scratch and no dump's allowed.txt excuses it ("KERNEL TARGET REASON" a line;
TARGET may be a prefix, intel:); if an excuse is no longer needed; if a kernel uses more than 32 KiB of local memory or groups of more than 256
items; or if --baseline's table was better: more scratch or spills, fewer waves, a share lower by more than 0.02, a missing kernel. --table
writes the table. A target that ends in ? is only reported. The last column of a table is a hash of what was compiled, how, and by which
compilers: rows with the same hash are taken from --baseline's table and not compiled, unless --anew is given.

Needs (Debian 12) clang-15, libclc-15 and rocm-device-libs, and a folder made by tests/gpu/fetch_compilers.sh, given by --intel: if installed,
Intel's compiler would be an OpenCL device, too. AMD's and Intel's compilers are those that their drivers are built on. For NVIDIA, LLVM's
NVPTX back end writes PTX (the rows nvptx:), and NVIDIA's assembler, ptxas of the CUDA toolkit, makes machine code of it (the rows nvidia:). Where
there is no ptxas, only nvidia: rows that --baseline's table has already are known; the others are left out, with a message.
"""
import argparse
import atexit
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile

TARGETS = ("amd:gfx90a,amd:gfx1030,amd:gfx1100?,intel:dg2,intel:pvc,intel:tgllp,nvptx:sm_80,nvidia:sm_75,nvidia:sm_80,nvidia:sm_90,"
           "nvidia:sm_120")
METHOD = "1"  # identifies how kernels are compiled and measured; change it when that changes
MOST_LOCAL, MOST_GROUP, SHARE_MARGIN = 32768, 256, 0.02
MULTIPLY_ADD = re.compile(r"\b(v_fma|v_fmac|v_dual_fmac|v_mad_f|v_mac_f|v_pk_fma|v_dot|v_mfma|v_wmma)\w*|\b(fma\.rn|mma\.)|"
                          r"^\s*(?:\([^)]*\)\s*)?(mad|madm|dpas|dpasw)\b", re.M)
CLANG = "clang-15"
BITCODE = ("/usr/lib/x86_64-linux-gnu/amdgcn/bitcode", "/usr/lib/amdgcn/bitcode", "/opt/rocm/amdgcn/bitcode")
LIBCLC = "/usr/lib/clc/nvptx64--.bc"
LIBCLC_NVIDIA = "/usr/lib/clc/nvptx64--nvidiacl.bc"  # with the registers of work-items, which an assembler needs to know
NO_OFFSET = "ulong __attribute__((overloadable)) get_global_offset(uint d) { return 0; }\n"  # what it leaves out
WARPS = {"sm_75": 32, "sm_80": 64, "sm_90": 64, "sm_120": 48}  # of a multiprocessor, at most
PTXAS = shutil.which("ptxas") or next((path for path in ("/usr/local/cuda/bin/ptxas",) if os.path.exists(path)), "")


class Compilers:
    """The compilers' paths; `version` changes with any of them."""

    def __init__(self, intel, ptxas):
        intel = os.path.abspath(intel) if intel else ""
        self.bitcode = next((d for d in (*([f"{intel}/usr/lib/x86_64-linux-gnu/amdgcn/bitcode"] if intel else []), *BITCODE)
                             if os.path.isdir(d)), None)
        self.later = self.with_later_chips(self.bitcode) if self.bitcode else None
        self.libraries = f"{intel}/usr/lib/x86_64-linux-gnu" if intel else ""
        self.ocloc = f"{intel}/usr/bin/ocloc" if intel else shutil.which("ocloc")
        self.iga = f"{intel}/usr/bin/iga64" if intel else shutil.which("iga64")
        self.ptxas = ptxas

    @staticmethod
    def with_later_chips(bitcode):
        """A folder of AMD's libraries in which chips that the compiler knows and the libraries do not are mapped to the newest chip that they know:
        the libraries only contain a chip's number."""
        newest = f"{bitcode}/oclc_isa_version_1036.bc"
        if not os.path.exists(newest) or os.path.exists(f"{bitcode}/oclc_isa_version_1100.bc"):
            return bitcode
        out = tempfile.mkdtemp(prefix="vsplat-bitcode-")
        atexit.register(shutil.rmtree, out, True)
        for name in os.listdir(bitcode):
            os.symlink(f"{bitcode}/{name}", f"{out}/{name}")
        os.symlink(newest, f"{out}/oclc_isa_version_1100.bc")
        return out

    def env(self):
        return {**os.environ, **({"LD_LIBRARY_PATH": self.libraries} if self.libraries else {})}

    def missing(self, vendors):
        """Returns what a vendor of `vendors` lacks, in words; "" if everything is there."""
        lacks = []
        if vendors & {"amd", "nvptx", "nvidia"} and not shutil.which(CLANG):
            lacks.append("clang-15")
        if "amd" in vendors and not self.bitcode:
            lacks.append("AMD's device libraries (rocm-device-libs)")
        if "nvptx" in vendors and not os.path.exists(LIBCLC) or "nvidia" in vendors and not os.path.exists(LIBCLC_NVIDIA):
            lacks.append("libclc-15")
        if "intel" in vendors and not (self.ocloc and os.path.exists(self.ocloc)):
            lacks.append("ocloc (intel-opencl-icd)")
        return ", ".join(lacks)

    def version(self):
        out = run([CLANG, "--version"]).stdout
        for path in (self.ocloc, self.libraries + "/libigc.so.1" if self.libraries else ""):
            if path and os.path.exists(path):
                out += f"{os.path.getsize(os.path.realpath(path))} "
        return out


def run(command, **options):
    return subprocess.run(command, capture_output=True, text=True, errors="replace", **options)


def loop_share(body, label, branch):
    """The share of multiply-adds among the instructions of the loop (from a label to the last branch back to it) that is densest in them."""
    lines, at, best = body.splitlines(), {}, (0, None)
    for i, line in enumerate(lines):
        if found := re.match(label, line.strip()):
            at[found[0].rstrip(":")] = i
        found = re.search(branch, line)
        if found and found[1] in at:
            code = [x for x in lines[at[found[1]]:i + 1] if re.match(r"\s+[a-z(@]", x) and not x.strip().startswith((".", ";", "//"))]
            n = sum(bool(MULTIPLY_ADD.search(x)) for x in code)
            if code and n and n * n / len(code) > best[0]:
                best = (n * n / len(code), n / len(code))
    return best[1]


def amd(compilers, source, options, chip, folder):
    out = f"{folder}/a.s"
    done = run([CLANG, "-x", "cl", *options, "-target", "amdgcn-amd-amdhsa", f"-mcpu={chip}", "-Xclang", "-finclude-default-header",
                f"--rocm-device-lib-path={compilers.later}", "-O3", "-S", "-o", out, source])
    if done.returncode:
        return None, done.stderr
    text, kernels = open(out).read(), {}
    for part in re.split(r"^  - \.", text.split("amdhsa.kernels:")[-1], flags=re.M)[1:]:
        def get(key):
            found = re.search(rf"\.{key}:\s+(\d+)", part)
            return int(found[1]) if found else 0
        name = re.search(r"\.symbol:\s+'?(\w+)\.kd", part)
        if not name:
            continue
        body = re.search(rf"^{name[1]}:.*?^\s*\.section", text, re.M | re.S)
        registers, old = get("vgpr_count"), chip.startswith("gfx9")
        waves = min(8 if chip == "gfx90a" else 10 if old else 16, (512 if old else 1024) // max(8, -(-registers // 8) * 8))
        kernels[name[1]] = {"registers": registers, "spill": 4 * (get("vgpr_spill_count") + get("sgpr_spill_count")),
                            "scratch": get("private_segment_fixed_size"), "local": get("group_segment_fixed_size"), "waves": waves,
                            "share": loop_share(body[0] if body else "", r"^\.?L?BB\d+_\d+:", r"s_c?branch\w*\s+(\S+)")}
    return kernels, ""


def sections(path):
    data = open(path, "rb").read()
    if data[:4] != b"\x7fELF":
        return {}
    start, = struct.unpack_from("<Q", data, 0x28)
    size, count, names = struct.unpack_from("<HHH", data, 0x3A)
    heads = [struct.unpack_from("<IIQQQQIIQQ", data, start + i * size) for i in range(count)]
    base = heads[names][4]
    return {data[base + h[0]:data.index(b"\0", base + h[0])].decode(): data[h[4]:h[4] + h[5]] for h in heads if h[1] != 8}


PLATFORMS = {"dg2": "xehpg", "pvc": "xehpc", "tgllp": "12p1"}  # as iga64 calls them


def intel_share(compilers, text, device, folder):
    """The listing of a kernel's machine code, by iga64; None if not available."""
    if not compilers.iga or not os.path.exists(compilers.iga) or device not in PLATFORMS:
        return None
    path = f"{folder}/text.bin"
    pathlib.Path(path).write_bytes(text)
    done = run([compilers.iga, "-d", f"-p={PLATFORMS[device]}", path], env=compilers.env())
    if done.returncode or not done.stdout:
        return None
    return loop_share(done.stdout, r"^L\d+:", r"\b(?:while|jmpi|brc|goto)\b.*?\b(L\d+)")


def intel(compilers, source, options, device, folder):
    for name in os.listdir(folder):
        os.remove(f"{folder}/{name}")
    done = run([compilers.ocloc, "compile", "-file", source, "-device", device, "-options", " ".join(options), "--format", "zebin", "-out_dir", folder,
                "-output", "i"], env=compilers.env(), cwd=folder)
    made = [name for name in os.listdir(folder) if name.endswith(".bin")]
    if done.returncode or not made or "INVALID" in done.stdout + done.stderr:
        return None, done.stdout + done.stderr
    parts, kernels = sections(f"{folder}/{made[0]}"), {}
    for part in re.split(r"^  - name:\s+", parts.get(".ze_info", b"").decode(errors="replace"), flags=re.M)[1:]:
        name = part.split()[0]
        if "execution_env:" not in part:
            continue
        def get(key):
            found = re.search(rf"\b{key}:\s+(\d+)", part)
            return int(found[1]) if found else 0
        usage = re.findall(r"usage:\s+(\w+)\s+size:\s+(\d+)", part)
        kernels[name] = {"registers": get("grf_count"), "waves": get("simd_size"), "local": get("slm_size"),
                         "spill": sum(int(size) for kind, size in usage if kind == "spill_fill_space"),
                         "scratch": sum(int(size) for kind, size in usage if kind != "spill_fill_space"),
                         "share": intel_share(compilers, parts.get(f".text.{name}", b""), device, folder)}
    return (kernels, "") if kernels else (None, "no kernel information in the binary")


def nvptx(compilers, source, options, chip, folder):
    out = f"{folder}/n.ptx"
    done = run([CLANG, "-x", "cl", *options, "-target", "nvptx64-nvidia-nvcl", f"-march={chip}", "-Xclang", "-finclude-default-header",
                "-Xclang", "-mlink-bitcode-file", "-Xclang", LIBCLC, "-O3", "-S", "-o", out, source])
    if done.returncode:
        return None, done.stderr
    kernels = {}
    for found in re.finditer(r"\.entry (\w+)\(.*?^}", open(out).read(), re.M | re.S):
        scratch = sum(map(int, re.findall(r"\.local \.align \d+ \.b8\s+\w+\[(\d+)\]", found[0])))
        kernels[found[1]] = {"scratch": scratch, "spill": 0, "share": loop_share(found[0], r"^\$\w+:", r"bra(?:\.uni)?\s+(\$\w+)")}
    return kernels, ""


def nvidia(compilers, source, options, chip, folder):
    llvm = [CLANG, "-x", "cl", "-target", "nvptx64-nvidia-nvcl", f"-march={'sm_75' if chip == 'sm_75' else 'sm_80'}", "-O3"]
    pathlib.Path(f"{folder}/offset.cl").write_text(NO_OFFSET)
    linked = [word for path in (LIBCLC_NVIDIA, f"{folder}/offset.bc") for word in ("-Xclang", "-mlink-bitcode-file", "-Xclang", path)]
    for command in ([*llvm, "-cl-std=CL1.2", "-emit-llvm", "-c", "-o", f"{folder}/offset.bc", f"{folder}/offset.cl"],
                    [*llvm, *options, "-Xclang", "-finclude-default-header", *linked, "-S", "-o", f"{folder}/n.ptx", source],
                    [compilers.ptxas, "-v", f"-arch={chip}", "-o", f"{folder}/n.cubin", f"{folder}/n.ptx"]):
        done = run(command)
        if done.returncode:
            return None, done.stderr
    kernels = {}
    for part in done.stderr.split("Compiling entry function '")[1:]:
        number = lambda what: int((re.search(rf"(\d+) {what}", part) or [0, 0])[1])
        registers = int(re.search(r"Used (\d+) registers", part)[1])
        kernels[part.split("'")[0]] = {"registers": registers, "spill": number("bytes spill stores"), "scratch": number("bytes stack frame"),
                                       "local": number("bytes smem"), "waves": min(WARPS[chip], 65536 // (-(-registers * 32 // 256) * 256))}
    return kernels, ""


VENDORS = {"amd": amd, "intel": intel, "nvptx": nvptx, "nvidia": nvidia}


def programs_of(dumps):
    """Kernels of the gpu flavour; kernels of equal programs are merged."""
    out = {}
    for dump in dumps:
        for program in json.load(open(f"{dump}/kernels.json")):
            if program.get("flavour", "gpu") != "gpu":
                continue
            text = open(f"{dump}/{program['source']}").read()
            known = out.setdefault((program["name"], program["options"], text), {**program, "kernels": [], "groups": {}, "path": f"{dump}/{program['source']}"})
            known["kernels"] = sorted({*known["kernels"], *program["kernels"]})
            for about in program.get("about", []):
                for launch in about["launches"]:
                    group = launch["group"] or [0]
                    size = group[0] * (group[1] * group[2] if len(group) > 1 else 1)
                    known["groups"][about["name"]] = max(size, known["groups"].get(about["name"], 0))
    return list(out.values())


def compiled(compilers, program, target, cache, version, known):
    """Returns rows of all of its kernels. known: {(kernel, target, hash): numbers} that need not be compiled."""
    vendor, chip = target.split(":")
    meant = set(program.get("targets", [vendor]))
    # A program for NVIDIA's matrix units needs those of sm_80.
    if not ({vendor, target} & meant or vendor == "nvidia" and "nvptx" in meant and chip != "sm_75"):
        return []
    text = open(program["path"]).read()
    key = hashlib.sha256("\0".join((METHOD, version, target, program["options"], text)).encode()).hexdigest()
    kept = f"{cache}/{key}.json" if cache else ""
    digest = key[:16]
    if all((kernel, target, digest) in known for kernel in program["kernels"]):
        got, why = {kernel: known[kernel, target, digest] for kernel in program["kernels"]}, ""
    elif kept and os.path.exists(kept):
        got, why = json.load(open(kept))
    elif vendor == "nvidia" and not compilers.ptxas:
        return [{"kernel": kernel, "target": target, "options": program["options"], "left_out": True} for kernel in program["kernels"]]
    else:
        with tempfile.TemporaryDirectory(prefix="vsplat-static-") as folder:
            source = f"{folder}/source.cl"
            work = f"{folder}/work"
            os.mkdir(work)
            shutil.copy(program["path"], source)
            got, why = VENDORS[vendor](compilers, source, program["options"].split(), chip, work)
        if kept and got:
            pathlib.Path(f"{kept}.{os.getpid()}.tmp").write_text(json.dumps([got, why]))
            os.replace(f"{kept}.{os.getpid()}.tmp", kept)
    rows = []
    for kernel in program["kernels"]:
        found = (got or {}).get(kernel)
        rows.append({"kernel": kernel, "program": program["name"], "options": program["options"].replace("-cl-std=CL1.2", "").strip(), "target": target,
                     "digest": digest, "group": program["groups"].get(kernel, 0), **(found or {"error": (why or "kernel not found").strip()[-300:]})})
    return rows


def excuses_of(dumps):
    out = []
    for dump in dumps:
        path = f"{dump}/allowed.txt"
        for line in open(path).read().splitlines() if os.path.exists(path) else []:
            if line.strip() and not line.startswith("#"):
                words = line.split(None, 2)
                if len(words) < 3:
                    sys.exit(f"{path}: \"{line}\": KERNEL TARGET REASON expected")
                out.append(tuple(words))
    return sorted(set(out))


def line_of(row):
    name = f"{row['kernel']:36} {row['options']:34} {row['target']:14}"
    if "error" in row:
        return f"{name} does not compile: {row['error'].splitlines()[-1][:120] if row['error'] else ''}"
    share = f"{row['share']:.2f}" if row.get("share") else "-"
    return (f"{name} {row.get('registers') or '-':>5} {row['spill']:>6} {row['scratch']:>8} {row.get('local', '-'):>7} {row.get('waves', '-'):>6}"
            f" {share:>6}  {row['digest']}")


HEAD = f"{'kernel':36} {'options':34} {'target':14} {'regs':>5} {'spill':>6} {'scratch':>8} {'local':>7} {'waves':>6} {'share':>6}  compiled"


def table_rows(path):
    """Returns {(kernel, options, target): numbers} of a table that --table wrote."""
    out = {}
    for line in open(path).read().splitlines():
        if not line.startswith(("#", "kernel ")) and ":" in line[72:86]:
            kernel, options, target = line[:36].strip(), line[37:71].strip(), line[72:86].strip()
            numbers = line[86:].split()
            if len(numbers) == 7:
                number = lambda text: None if text == "-" else float(text) if "." in text else int(text)
                out[kernel, options, target] = {**dict(zip(("registers", "spill", "scratch", "local", "waves", "share"), map(number, numbers))),
                                                "digest": numbers[6]}
    return out


def known_of(path):
    """Returns the rows of that table that `compiled` can reuse."""
    known = {}
    for (kernel, _, target), numbers in table_rows(path).items():
        report = {key: value for key, value in numbers.items() if value is not None and key != "digest"}
        known[kernel, target, numbers["digest"]] = {"spill": 0, "scratch": 0, **report}
    return known


def worse(row, before):
    """Returns what got worse, in words."""
    out = []
    for key in ("spill", "scratch"):
        if row[key] > (before[key] or 0):
            out.append(f"{key} {before[key] or 0:.0f} -> {row[key]}")
    if row["target"].startswith(("amd", "nvidia")) and before["waves"] and row["waves"] < before["waves"]:
        out.append(f"waves {before['waves']:.0f} -> {row['waves']}")
    if before["share"] and (row.get("share") or 0) < before["share"] - SHARE_MARGIN:
        out.append(f"share of multiply-adds {before['share']:.2f} -> {row.get('share') or 0:.2f}")
    return out


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("dumps", nargs="+")
    ap.add_argument("--targets", default=TARGETS)
    ap.add_argument("--only", default="")
    ap.add_argument("--json")
    ap.add_argument("--table")
    ap.add_argument("--baseline")
    ap.add_argument("--anew", action="store_true")
    ap.add_argument("--cache")
    ap.add_argument("--intel", default=os.environ.get("VSPLAT_GPU_COMPILERS", ""))
    ap.add_argument("--ptxas", default=PTXAS)
    ap.add_argument("--jobs", type=int, default=os.cpu_count())
    a = ap.parse_args()
    targets = {t.rstrip("?"): t.endswith("?") for t in a.targets.split(",")}
    compilers = Compilers(a.intel, a.ptxas)
    if lacks := compilers.missing({t.split(":")[0] for t in targets}):
        print(f"static_check: there is no {lacks} here", file=sys.stderr)
        return 77
    if a.cache:
        os.makedirs(a.cache, exist_ok=True)
    programs = [p for p in programs_of(a.dumps) if a.only in p["name"] or any(a.only in k for k in p["kernels"])]
    version = compilers.version()
    known = known_of(a.baseline) if a.baseline and not a.anew else {}
    with concurrent.futures.ThreadPoolExecutor(a.jobs) as pool:
        work = [pool.submit(compiled, compilers, p, t, a.cache, version, known) for p in programs for t in targets]
        every = [row for done in work for row in done.result()]
    rows = [row for row in every if "left_out" not in row]
    left_out = len(every) - len(rows)
    rows.sort(key=lambda row: (row["program"], row["kernel"], row["options"], list(targets).index(row["target"])))
    if a.json:
        with open(a.json, "w") as out:
            json.dump(rows, out, indent=1)
    text = HEAD + "\n" + "".join(line_of(row) + "\n" for row in rows)
    sys.stdout.write(text)
    if a.table:
        pathlib.Path(a.table).write_text(text)

    excuses, used, problems = excuses_of(a.dumps), set(), []
    for row in rows:
        if targets[row["target"]]:
            continue
        where = f"{row['kernel']} {row['options']} on {row['target']}".replace("  ", " ")
        if "error" in row:
            problems.append(f"{where} does not compile: {row['error']}")
            continue
        if row["spill"] or row["scratch"]:
            excused = [e for e in excuses if e[0] == row["kernel"] and row["target"].startswith(e[1])]
            used.update(excused)
            if not excused:
                problems.append(f"{where}: {row['spill']} bytes spilled, {row['scratch']} of scratch")
        if (row.get("local") or 0) > MOST_LOCAL:
            problems.append(f"{where}: {row['local']} bytes of local memory, at most {MOST_LOCAL} expected")
        if row["group"] > MOST_GROUP:
            problems.append(f"{where}: groups of {row['group']} items, at most {MOST_GROUP} expected")
    if not a.only and a.targets == TARGETS:
        problems += [f"allowed.txt: {kernel} {target} keeps nothing any longer: take the line away" for kernel, target, _ in excuses
                     if (kernel, target, _) not in used and not (left_out and target.startswith("nvidia"))]
    if a.baseline:
        before, now = table_rows(a.baseline), {(r["kernel"], r["options"], r["target"]): r for r in rows}
        if not before:
            problems.append(f"{a.baseline}: no table")
        for key, numbers in before.items():
            if key[2] not in targets or targets[key[2]] or (a.only and a.only not in key[0]):
                continue
            if key not in now and not (left_out and key[2].startswith("nvidia")):
                problems.append(f"{' '.join(key)} is in {os.path.basename(a.baseline)}, and no longer in the dump: if that is meant, write the table with --table")
            elif key in now and "error" not in now[key]:
                problems += [f"{' '.join(key)}: {what}" for what in worse(now[key], numbers)]
    for problem in problems:
        print(problem, file=sys.stderr)
    if left_out:
        print(f"there is no ptxas: {left_out} kernels and targets of NVIDIA are not in {a.baseline or 'a table'}, and left out", file=sys.stderr)
    print(f"{len(rows)} kernels and targets, {len(used)} excuses, {len(problems)} problems", file=sys.stderr)
    if known:
        same = sum((row["kernel"], row["target"], row["digest"]) in known for row in rows)
        print(f"{same} of them as they were compiled for {os.path.basename(a.baseline)}", file=sys.stderr)
    return 1 if problems or not rows else 0


if __name__ == "__main__":
    sys.exit(main())
