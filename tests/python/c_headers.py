"""The public C headers for ctypes: their constants, handles, structs with the _INIT macros, function types and functions, as declared.

A declaration that this parser does not know becomes an Unknown with its text, so that nothing is skipped silently."""
import ctypes as c
import dataclasses
import pathlib
import re

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "model/api/include/vsplat"
BASE = {"char": c.c_char, "uint8_t": c.c_uint8, "int32_t": c.c_int32, "int64_t": c.c_int64, "uint32_t": c.c_uint32, "uint64_t": c.c_uint64, "size_t": c.c_size_t,
        "float": c.c_float, "double": c.c_double, "cl_uint": c.c_uint32}
OPAQUE = ("cl_context", "cl_device_id", "cl_command_queue", "cl_mem", "cl_event")  # OpenCL's types, all pointers


class Unknown(Exception):
    pass


@dataclasses.dataclass
class Declared:
    """A parameter or a field."""
    name: str
    base: str  # the type's name without const and stars; for an inline function type the declaration
    stars: int
    const: bool  # the memory that it points to is not written
    lengths: tuple  # of arrays
    ctype: type

    @property
    def is_pointer(self):
        return self.stars > 0 or self.base in OPAQUE


@dataclasses.dataclass
class Function:
    name: str
    returns: str
    parameters: list
    comment: str  # the comment above it


class Headers:
    def __init__(self, folder=FOLDER):
        self.constants, self.inits, self.structs, self.fields, self.prototypes, self.functions = {}, {}, {}, {}, {}, {}
        self.handles, self.enums = set(), set()
        for file in _in_order(folder):
            text = file.read_text()
            comments = []
            text = re.sub(r"/\*(.*?)\*/", lambda m: comments.append(" ".join(m[1].split())) or f"@{len(comments) - 1}@", text, flags=re.S)
            text = self._macros(text.replace("\\\n", " "))
            text = re.sub(r'extern "C" \{|^\s*\}\s*$', "", text, flags=re.M)
            for found in re.finditer(r"([^;{}]*)(\{[^{}]*\})?([^;{}]*);", text):
                self._declaration(found[0], comments)

    def _macros(self, text):
        for name, value in re.findall(r"^#define[ \t]+(VSPLAT_\w+)[ \t]+(\S.*)$", text, flags=re.M):
            value = re.sub(r"@\d+@", "", value).strip()
            if name.endswith("_INIT"):
                self.inits[name] = value
            elif re.fullmatch(r"[-\d.]+", value):
                self.constants[name] = float(value) if "." in value else int(value)
        return re.sub(r"^\s*#.*$", "", text, flags=re.M)

    def _declaration(self, text, comments):
        comment = [comments[int(i)] for i in re.findall(r"@(\d+)@", text.split("VSPLAT_API")[0])]
        text = " ".join(re.sub(r"@\d+@", "", text).split())
        if not text.rstrip(";"):
            return
        if m := re.fullmatch(r"typedef enum (\w+) \{(.*)\} \1;", text):
            self.enums.add(m[1])
            for value in filter(None, (v.strip() for v in m[2].split(","))):
                name, _, number = value.partition("=")
                self.constants[name.strip()] = int(number, 0)
        elif m := re.fullmatch(r"typedef struct (\w+)_impl\* \1;", text):
            self.handles.add(m[1])
        elif m := re.fullmatch(r"typedef struct (\w+) \{(.*)\} \1;", text):
            self.fields[m[1]] = [d for line in m[2].split(";") if line.strip() for d in self._line(line)]
            self.structs[m[1]] = type(m[1], (c.Structure,), {"_fields_": [(d.name, d.ctype) for d in self.fields[m[1]]]})
        elif m := re.fullmatch(r"typedef (.*?)\(\*(\w+)\)\((.*)\);", text):
            self.prototypes[m[2]] = self._prototype(m[1], m[3])
        elif m := re.fullmatch(r"VSPLAT_API (?:VSPLAT_NODISCARD )?([\w\s]+?\*?) ?(vsplat_\w+)\((.*)\);", text):
            parameters = [] if m[3] == "void" else [d for p in _split(m[3]) for d in self._line(p)]
            self.functions[m[2]] = Function(m[2], m[1], parameters, comment[-1] if comment else "")
        else:
            raise Unknown(f"a declaration of a kind that tests/python/c_headers.py does not know: {text}")

    def _prototype(self, returns, parameters):
        types = [d.ctype if not isinstance(d.ctype, type) or not issubclass(d.ctype, c.Array) else c.c_void_p
                 for p in _split(parameters) for d in self._line(p)]
        return c.CFUNCTYPE(self._type(returns.strip(), 0), *types)

    def _line(self, line):
        """Parses a line's declaration of one or more names of a type."""
        line = line.strip()
        if m := re.fullmatch(r"(.*?)\(\*(\w+)\)\((.*)\)", line):
            self.prototypes[f"({m[2]})({m[3]})"] = self._prototype(m[1], m[3])
            return [Declared(m[2], f"({m[2]})({m[3]})", 0, False, (), c.c_void_p)]
        m = re.fullmatch(r"(const )?(\w+)((?:\s*\*(?: const)?)*) ?(.+)", line)
        if not m:
            raise Unknown(f"a line of a kind that tests/python/c_headers.py does not know: {line}")
        out = []
        for name in _split(m[4]):
            lengths = tuple(self.constants[n] if n in self.constants else int(n) for n in re.findall(r"\[(\w+)\]", name))
            name, stars = re.sub(r"\[.*", "", name).strip(), m[3].count("*")
            type_ = self._type(m[2], stars)
            for n in reversed(lengths):
                type_ = type_ * n
            out.append(Declared(name, m[2], stars, bool(m[1]), lengths, type_))
        return out

    def _type(self, name, stars):
        name = name.replace("const ", "").strip()
        if stars or name.endswith("*") or name in self.handles or name in self.prototypes or name in OPAQUE:
            return c.c_void_p
        if name == "void":
            return None
        if name in self.enums:
            return c.c_int
        if name in BASE:
            return BASE[name]
        if name in self.structs:
            return self.structs[name]
        raise Unknown(f"a type that tests/python/c_headers.py does not know: {name}")

    def bind(self, library):
        """Loads the library's functions with the headers' types."""
        out = {}
        for function in self.functions.values():
            out[function.name] = entry = getattr(library, function.name)
            entry.restype = c.c_char_p if function.returns == "const char*" else self._type(function.returns, 0)
            entry.argtypes = [c.c_void_p if d.lengths else d.ctype for d in function.parameters]
        return out

    def struct(self, name, **values):
        """Returns a struct with the values of its _INIT macro."""
        init = re.sub(r"\b\w+_INIT\b", lambda m: self.inits[m[0]], self.inits[name.upper() + "_INIT"])
        tokens = re.findall(r'sizeof\(\w+\)|[{},]|"[^"]*"|[-\w.]+', init)
        out = self.structs[name]()
        if self._fill(out, tokens) or tokens:
            raise Unknown(f"{name.upper()}_INIT is not an initializer of {name}")
        for field, value in values.items():
            set_field(out, field, value)
        return out

    def _fill(self, out, tokens):
        assert tokens.pop(0) == "{"
        places = range(len(out)) if isinstance(out, c.Array) else [name for name, _ in out._fields_]
        for place in places:
            if tokens[0] == "}":
                if not isinstance(out, c.Array):
                    raise Unknown(f"the _INIT macro of {type(out).__name__} leaves out {place} and what follows")
                break
            if tokens[0] == ",":
                tokens.pop(0)
            inner = None if isinstance(out, c.Array) else dict(out._fields_)[place]
            if tokens[0] == "{" and inner and issubclass(inner, c.Array) and inner._type_ is c.c_char:
                del tokens[:tokens.index("}") + 1]  # {0}: unchanged
                continue
            if tokens[0] == "{":
                self._fill(out[place] if isinstance(out, c.Array) else getattr(out, place), tokens)
                continue
            token = tokens.pop(0)
            if token.startswith("sizeof"):
                value = c.sizeof(self.structs[token[7:-1]])
            elif token == "NULL" or token.startswith('"'):
                value = None if token == "NULL" else token[1:-1].encode()
            else:
                value = self.constants[token] if token in self.constants else float(token) if "." in token else int(token)
            if isinstance(out, c.Array):
                out[place] = value
            else:
                set_field(out, place, value)
        return tokens.pop(0) != "}"


def _in_order(folder):
    """Sorts headers after those that they include."""
    out = []

    def visit(file):
        if file in out:
            return
        for name in re.findall(r"^#include <vsplat/(\w+\.h)>", file.read_text(), flags=re.M):
            if (folder / name).exists():  # two headers are made by the build
                visit(folder / name)
        out.append(file)

    for file in sorted(folder.glob("*.h")):
        visit(file)
    return out


def _split(text):
    """Splits at commas outside parentheses."""
    out, depth = [""], 0
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and not depth:
            out.append("")
        else:
            out[-1] += letter
    return [part.strip() for part in out if part.strip()]


def set_field(struct, name, value):
    """Sets a field's value; the memory that it points to is stored with the struct."""
    type_ = dict(struct._fields_)[name]
    if type_ is c.c_void_p and value is not None and not isinstance(value, int):
        kept = struct.__dict__.setdefault("kept", [])
        kept.append(value)
        if isinstance(value, bytes):
            value = c.create_string_buffer(value)
            kept.append(value)
        value = value.value if isinstance(value, c.c_void_p) else c.cast(value, c.c_void_p).value
    elif isinstance(value, (list, tuple)):
        value = type_(*value)
    setattr(struct, name, value)
