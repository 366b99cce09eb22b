"""The binary interface, compared with the committed one (abi.txt): what programs linked earlier rely on must not change.

`abi_test.py --write` adds new entries, in the commit that adds them; removing or changing an entry needs a new VSPLAT_SOVERSION."""
import ctypes as c
import os
import pathlib
import re
import subprocess
import sys
import unittest

import c_headers

BASELINE = pathlib.Path(__file__).with_name("abi.txt")


def interface(headers):
    """Yields one line for each property that a compiled program contains."""
    out = set()
    for function in headers.functions.values():
        types = ", ".join(f"{'const ' if p.const else ''}{p.base}{'*' * p.stars}{'[]' * len(p.lengths)}" for p in function.parameters)
        out.add(f"function {function.name}: {function.returns}({types})")
    for name, struct in headers.structs.items():
        for field in headers.fields[name]:
            at = getattr(struct, field.name)
            out.add(f"field {name}.{field.name}: {at.size} bytes at {at.offset}, {'const ' if field.const else ''}{field.base}{'*' * field.stars}")
        # Structs that are embedded in others, and those without a size field, keep their size forever.
        held = any(f.base == name and not f.stars for fields in headers.fields.values() for f in fields)
        if held or headers.fields[name][0].name != "size":
            out.add(f"size {name}: {c.sizeof(struct)} bytes, fixed")
    kind = lambda t: "void" if t is None else t.__name__
    for name, function in headers.prototypes.items():
        out.add(f"callback {name}: {kind(function._restype_)}({', '.join(map(kind, function._argtypes_))})")
    for name, value in headers.constants.items():
        if isinstance(value, int):
            out.add(f"constant {name}: {value}")
    return out


class Abi(unittest.TestCase):
    def setUp(self):
        self.now = interface(c_headers.Headers())

    def test_what_was_there_is_there_as_it_was(self):
        before = set(BASELINE.read_text().splitlines())
        gone, new = sorted(before - self.now), sorted(self.now - before)
        self.assertEqual(gone, [], "programs that were linked before break: undo it, or raise VSPLAT_SOVERSION and tell why in CHANGELOG.md")
        self.assertEqual(new, [], "this is new: tests/python/abi_test.py --write keeps it")

    def test_the_library_has_the_functions_and_nothing_else(self):
        library = os.environ["VSPLAT_LIBRARY"]
        found = subprocess.run(["nm", "-D", "--defined-only", "--with-symbol-versions", library], capture_output=True, text=True, check=True).stdout
        symbols = {line.split()[-1] for line in found.splitlines() if " A " not in line}
        declared = {line.split()[1].rstrip(":") for line in self.now if line.startswith("function ")}
        inline = {name for name in declared if not any(s.startswith(name + "@") for s in symbols)}
        self.assertEqual(inline, set(), "declared, and not in the library")
        # The kernels' sources, for this tree's own tests, which link the internals beside the library.
        self.assertEqual({re.sub("@.*", "", s) for s in symbols} - {"vsplat_embedded_files"}, declared)
        self.assertEqual({re.sub(".*@@", "", s) for s in symbols}, {"VSPLAT_0.2"})


if __name__ == "__main__":
    if "--write" in sys.argv:
        BASELINE.write_text("".join(line + "\n" for line in sorted(interface(c_headers.Headers()))))
    else:
        unittest.main(verbosity=2)
