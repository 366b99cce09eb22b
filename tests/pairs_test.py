"""Operations: every *_forward and *_backward of model/ops and model/networks/layers/layers.h is part of a pair in one header, the forward
first, and so are the kernels; an operation's files share one stem, and its benchmark runs every operation that its header declares.
Exceptions are listed here, each with its reason."""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
OPS = ROOT / "model" / "ops"
LAYERS = ROOT / "model" / "networks" / "layers" / "layers.h"

FORWARD_ALONE = {
    "plucker": "cameras have no gradient",
    "sparse_map": "indices have no derivative",
}
# Operations of runtime/, which have cases of the self-test and tests of their own.
RUNTIME = {"column_sum", "compose_rows", "gemm", "peak"}
# Operations that are not named after their header.
IN_HEADER = {
    "modulate": "layernorm",  # a LayerNorm with a scale and a shift for each token, with the same kernels
    "submanifold": "sparse_conv",  # beside sparse_map, the other half of sparse convolutions
}
KERNELS_BACKWARD_ALONE = {
    "conv3d_down": "the forward is a GEMM over patches",
    "loss": "loss_value and those before it are the forward, of which the backward takes most",
    "submanifold": "the forward is a GEMM over a map",
}
# Functions in headers that are not operations, and that no benchmark times.
NO_OPERATIONS = re.compile(r"make_(culled|gaussians|picture|rows)|pack_\w+|upload_views|gpu_tile")  # they make, pack or choose

DECLARATION = re.compile(r"^[A-Za-z][\w:<>,& ]*?[ &](\w+)_(forward|backward)(?:_\w+)?\(Context& ctx", re.M)
STRUCT = re.compile(r"^struct (\w+?)(Forward|Backward)\w* \{", re.M)
FUNCTION = re.compile(r"^[A-Za-z][\w:<>,& ]*?[ &](\w+)\(Context& ctx", re.M)
KERNEL = re.compile(r"\bkernel\s+(?:[A-Z_]+\s+|__attribute__\(\(.*?\)\)\s+)*void\s+(\w+)\(")


def without_comments(text):
    return re.sub(r"//[^\n]*", "", text)


def pair_problems(headers):
    """headers {name: text}. Returns what is wrong with the pairs that they declare, one line each."""
    found, problems = {}, []
    for header, text in headers.items():
        text = without_comments(text)
        for pattern in (DECLARATION, STRUCT):
            for match in pattern.finditer(text):
                key = (pattern is STRUCT, match[1])
                found.setdefault(key, {}).setdefault(match[2].lower(), []).append((header, match.start()))
    for (is_struct, name), sides in sorted(found.items()):
        forward, backward = (f"{name}{side.capitalize()}" if is_struct else f"{name}_{side}()" for side in ("forward", "backward"))
        if "forward" not in sides:
            if not is_struct or sides["backward"][0][0] != LAYERS.name:  # forwards of layers take their few arguments separately
                problems.append(f"{sides['backward'][0][0]}: {backward} without {forward}")
        elif "backward" not in sides:
            if name.lower().replace("_", "") not in {one.replace("_", "") for one in FORWARD_ALONE}:
                problems.append(f"{sides['forward'][0][0]}: {forward} without {backward}, and no reason for it in {pathlib.Path(__file__).name}")
        else:
            if name in FORWARD_ALONE:
                problems.append(f"{sides['backward'][0][0]}: {backward}, which FORWARD_ALONE says there is none of")
            for header, at in sides["backward"]:
                before = [place for other, place in sides["forward"] if other == header and place < at]
                if not before:
                    problems.append(f"{header}: {backward} without {forward} above it")
    return problems


def kernel_problems(sources):
    """sources {name: text of cl/*.cl}. Returns what is wrong with the names of their kernels."""
    kernels = {kernel: source for source, text in sources.items() for kernel in KERNEL.findall(without_comments(text))}
    problems = []
    for kernel, source in sorted(kernels.items()):
        if re.search(r"_(fwd|bwd|gradient)(_|$)", kernel) or re.search(r"_(cpu|gpu)_", kernel):
            problems.append(f"{source}: kernel {kernel}: its suffix is _forward or _backward, and the flavour after it")
        match = re.match(r"(\w+?)_backward", kernel)
        if match and match[1] not in KERNELS_BACKWARD_ALONE and not any(other.startswith(match[1] + "_forward") for other in kernels):
            problems.append(f"{source}: kernel {kernel} without a {match[1]}_forward")
    return problems


def case_problems(stems, cases, tests):
    """stems, cases {stem: text of its case file} and tests {stem: text}. Returns which cases are missing or not run by their test, one line each."""
    problems = [f"cases/{stem}.cpp: no operation has this name" for stem in sorted(set(cases) - set(stems))]
    for stem in sorted(stems):
        if f"VSPLAT_CASES({stem}," not in cases.get(stem, ""):
            problems.append(f"{stem}: no cases/{stem}.cpp with VSPLAT_CASES({stem}, ...)")
        if stem not in RUNTIME and not re.search(rf"\bVSPLAT_OPERATION\(\w+, {stem}\)", tests.get(stem, "")):
            problems.append(f"{stem}: {stem}_test.cpp does not run its case: VSPLAT_OPERATION(..., {stem})")
    return problems


def benchmark_problems(headers, benchmarks):
    """headers and benchmarks {stem: text}. Returns what `vsplat bench STEM` does not time, one line each."""
    problems = []
    for stem, text in headers.items():
        if stem not in benchmarks:
            problems.append(f"{stem}.h: neither bench/ops/{stem}.cpp nor bench/{stem}.cpp")
            continue
        for function in sorted(set(FUNCTION.findall(without_comments(text)))):
            if not NO_OPERATIONS.fullmatch(function) and not re.search(rf"\b{function}\(ctx", benchmarks[stem]):
                problems.append(f"{stem}.h: {function}(), which the benchmark {stem}.cpp does not run")
    return problems


def read(paths):
    return {path.name: path.read_text() for path in paths}


class Pairs(unittest.TestCase):
    def test_every_forward_has_its_backward(self):
        headers = read([*sorted(OPS.rglob("*.h")), LAYERS])
        self.assertGreater(sum(len(DECLARATION.findall(without_comments(text))) for text in headers.values()), 40)
        self.assertEqual(pair_problems(headers), [])

    def test_kernels_are_named_alike(self):
        sources = read(sorted((ROOT / "cl").rglob("*.cl")))
        self.assertGreater(sum(len(KERNEL.findall(text)) for text in sources.values()), 80)
        self.assertEqual(kernel_problems(sources), [])

    def test_operations_are_named_after_their_header(self):
        for header in sorted(OPS.rglob("*.h")):
            for name, _ in DECLARATION.findall(without_comments(header.read_text())):
                with self.subTest(operation=name, header=header.name):
                    self.assertTrue(name == header.stem or name.startswith(header.stem + "_") or IN_HEADER.get(name) == header.stem)

    def test_one_stem_everywhere(self):
        listed = re.findall(r"^  (\w+/\w+)$", (ROOT / "cmake" / "operations.cmake").read_text(), re.M)
        self.assertEqual(sorted(listed), sorted(f"{header.parent.name}/{header.stem}" for header in OPS.rglob("*.h")))
        for operation in listed:
            family, stem = operation.split("/")
            files = {"source": [OPS / family / f"{stem}.cpp"], "kernel": list((ROOT / "cl" / family).glob(f"{stem}*.cl")),
                     "test": [ROOT / "tests" / "model" / "ops" / family / f"{stem}_test.cpp"]}
            for what, paths in files.items():
                with self.subTest(stem=stem, file=what):
                    self.assertTrue(paths and all(path.is_file() for path in paths), f"{what} of {stem}: {[str(p) for p in paths]}")

    def test_every_operation_has_one_case(self):
        cases = {path.stem: path.read_text() for path in (ROOT / "model" / "diagnose" / "selftest" / "cases").glob("*.cpp")}
        tests = {path.stem.removesuffix("_test"): path.read_text() for path in (ROOT / "tests" / "model" / "ops").rglob("*_test.cpp")}
        stems = {header.stem for header in OPS.rglob("*.h")} | RUNTIME
        self.assertEqual(case_problems(stems, cases, tests), [])

    def test_every_operation_has_a_benchmark(self):
        headers = {path.stem: path.read_text() for path in sorted(OPS.rglob("*.h"))}
        headers["gemm"] = (ROOT / "runtime" / "gemm.h").read_text()
        benchmarks = {path.stem: path.read_text() for folder in ("bench", "bench/ops") for path in (ROOT / folder).glob("*.cpp")}
        self.assertGreater(sum(len(FUNCTION.findall(without_comments(text))) for text in headers.values()), 60)
        self.assertEqual(benchmark_problems(headers, benchmarks), [])


    def test_kernels_know_their_place_in_a_launch_of_parts(self):
        """Kernels do not use OpenCL's own counts of groups and sizes, which are those of a part of the launch: see runtime/launch_parts.h."""
        for path in sorted((ROOT / "cl").rglob("*.cl*")):
            if path.name == "common.clh":  # GROUP_ID
                continue
            for name in ("get_group_id", "get_num_groups", "get_global_size", "get_global_offset"):
                self.assertNotIn(name, without_comments(path.read_text()), f"{path.name}: GROUP_ID(), or an argument")


class Faults(unittest.TestCase):
    """The checks of this test find planted mistakes."""
    GOOD = ("struct TurnForward {\n};\nvoid turn_forward(Context& ctx, const TurnForward& a);\n"
            "struct TurnBackward {\n};\nvoid turn_backward(Context& ctx, const TurnBackward& a);\n")

    def problems(self, old, new):
        return pair_problems({"turn.h": self.GOOD.replace(old, new)})

    def test_pairs(self):
        self.assertEqual(self.problems("", ""), [])
        self.assertEqual(self.problems("turn_forward", "turn"), ["turn.h: turn_backward() without turn_forward()"])
        self.assertEqual(len(self.problems("turn_backward", "turn_gradient")), 1)
        self.assertEqual(len(self.problems("TurnForward", "Turn")), 1)
        forward, backward = self.GOOD[:len(self.GOOD) // 2 - 2], self.GOOD[len(self.GOOD) // 2 - 2:]
        self.assertEqual(len(pair_problems({"turn.h": backward + forward})), 2)
        self.assertEqual(len(pair_problems({"turn.h": forward, "turn_backward.h": backward})), 2)

    def test_benchmarks(self):
        good = "turn_forward(ctx, a); turn_backward(ctx, a);"
        self.assertEqual(benchmark_problems({"turn": self.GOOD}, {"turn": good}), [])
        self.assertEqual(len(benchmark_problems({"turn": self.GOOD}, {})), 1)
        self.assertEqual(len(benchmark_problems({"turn": self.GOOD}, {"turn": "turn_forward(ctx, a);"})), 1)

    def test_cases(self):
        case, test = 'VSPLAT_CASES(turn, {"turn", turn_all})', "VSPLAT_OPERATION(Turn, turn)"
        self.assertEqual(case_problems({"turn"}, {"turn": case}, {"turn": test}), [])
        self.assertEqual(len(case_problems({"turn"}, {}, {"turn": test})), 1)
        self.assertEqual(len(case_problems({"turn"}, {"turn": case}, {"turn": ""})), 1)
        self.assertEqual(len(case_problems({"turn"}, {"turn": case, "other": ""}, {"turn": test})), 1)

    def test_kernels(self):
        good = "kernel void turn_forward_cpu(int n) {}\nkernel __attribute__((reqd_work_group_size(1, 1, 1))) void turn_backward(int n) {}"
        self.assertEqual(kernel_problems({"turn.cl": good}), [])
        for old, new in (("forward", "fwd"), ("forward_cpu", "cpu_forward"), ("turn_forward", "turn"), ("backward", "gradient")):
            with self.subTest(new=new):
                self.assertNotEqual(kernel_problems({"turn.cl": good.replace(old, new)}), [])


if __name__ == "__main__":
    unittest.main()
