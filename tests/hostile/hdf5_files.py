"""Objects in HDF5: arrays that claim to be huge, values in other files, links that lead elsewhere. Made with the library that reads them."""
import ctypes
import ctypes.util
import math
import os
import sys

SIZE, UNLIMITED = ctypes.c_uint64, ctypes.c_uint64(-1).value
SIDE = 16384  # the largest permitted picture, as a square


class Library:
    def __init__(self):
        name = ctypes.util.find_library("hdf5_serial") or ctypes.util.find_library("hdf5")
        if name is None:
            sys.exit("no library of HDF5 is installed (Debian: libhdf5-dev), which makes the hostile files of that format")
        self.library = ctypes.CDLL(name)
        self.library.H5open()

    def __call__(self, function, *arguments, result=ctypes.c_int64):
        call = getattr(self.library, function)
        call.restype = result
        out = call(*arguments)
        assert out >= 0, f"{function} failed"
        return out

    def constant(self, name):
        return ctypes.c_int64(ctypes.c_int64.in_dll(self.library, name).value)


def sizes(values):
    return (SIZE * len(values))(*values)


class File:
    """A file with an object of six views; parts of the first view are replaced."""
    H = None
    ID = ctypes.c_int64

    def __init__(self, path):
        File.H = File.H or Library()
        self.file = self.ID(self.H("H5Fcreate", path.encode(), ctypes.c_uint(2), self.ID(0), self.ID(0)))

    def group(self, name="object"):
        made = self.H("H5Gcreate2", self.file, name if isinstance(name, bytes) else name.encode("utf-8", "surrogateescape"), self.ID(0), self.ID(0), self.ID(0))
        return self.ID(made)

    def array(self, group, name, shape, kind="H5T_NATIVE_FLOAT_g", data=None, layout=None, most=None):
        """layout: sets the creation property list. data: bytes in C order."""
        H, ID = self.H, self.ID
        space = ID(H("H5Screate_simple", len(shape), sizes(shape), sizes(most) if most else None))
        made = ID(H("H5Pcreate", H.constant("H5P_CLS_DATASET_CREATE_ID_g")))
        if layout:
            layout(H, ID, made)
        kind = H.constant(kind) if isinstance(kind, str) else kind
        dataset = ID(H("H5Dcreate2", group, name.encode(), kind, space, ID(0), made, ID(0)))
        if data is not None:
            H("H5Dwrite", dataset, kind, ID(0), ID(0), ID(0), data, result=ctypes.c_int)
        for close, what in (("H5Dclose", dataset), ("H5Pclose", made), ("H5Sclose", space)):
            H(close, what, result=ctypes.c_int)

    def view(self, group, index, picture=True, pose=True, fov=True):
        side, angle = 16, 2.0 * index
        if picture:
            self.array(group, f"image_{index}", (side, side, 4), "H5T_NATIVE_UCHAR_g", bytes((7 * i + index) % 256 for i in range(side * side * 4)))
        if pose:
            s, c = math.sin(angle), math.cos(angle)
            values = [-c, 0, s, -2 * s, 0, 1, 0, 0, -s, 0, -c, 2 * c, 0, 0, 0, 1]  # a rotation; x right, y down, z forward
            self.array(group, f"c2w_{index}", (4, 4), data=(ctypes.c_float * 16)(*values))
        if fov:
            self.array(group, f"fov_{index}", (2,), data=(ctypes.c_float * 2)(0.8, 0.8))

    def soft(self, target, group, name):
        self.H("H5Lcreate_soft", target.encode(), group, name.encode(), self.ID(0), self.ID(0), result=ctypes.c_int)

    def external(self, file, target, group, name):
        self.H("H5Lcreate_external", file.encode(), target.encode(), group, name.encode(), self.ID(0), self.ID(0), result=ctypes.c_int)

    def close(self):
        self.H("H5Fclose", self.file, result=ctypes.c_int)
        # Parts that the makers left out.
        self.H("H5garbage_collect", result=ctypes.c_int)


def make(maker):
    choose, number = maker.random.choice, maker.random.randint

    def put(kind, change, **without):
        """change(file, group): adds what the first view lacks."""
        folder = maker.folder(f"hdf5/{kind}")
        path = os.path.join(folder, maker.word() + ".h5")
        file = File(path)
        group = file.group()
        file.view(group, 0, **without)
        for i in range(1, 6):
            file.view(group, i)
        if change:
            change(file, group)
        file.H("H5Gclose", group, result=ctypes.c_int)
        file.close()
        maker.add(f"hdf5/{kind}", "hdf5", path)
        return path

    bytes_ = "H5T_NATIVE_UCHAR_g"
    huge = (number(60_000, 65_535), number(60_000, 65_535), 4)
    beyond = (2**40, 2**40, 4)
    large = (SIDE, SIDE, 4)
    chunked = lambda *chunk: lambda H, ID, made: H("H5Pset_chunk", made, len(chunk), sizes(chunk), result=ctypes.c_int)
    late = lambda H, ID, made: H("H5Pset_alloc_time", made, 3, result=ctypes.c_int)  # nothing is stored before values are written

    def filled(H, ID, made):
        chunked(64, 64, 4)(H, ID, made)
        H("H5Pset_fill_value", made, H.constant(bytes_), (ctypes.c_ubyte * 1)(number(0, 255)), result=ctypes.c_int)
    put("fill_huge", lambda f, g: f.array(g, "image_0", large, bytes_, layout=filled), picture=False)
    put("fill_beyond", lambda f, g: f.array(g, "image_0", huge, bytes_, layout=filled), picture=False)
    put("fill_far_beyond", lambda f, g: f.array(g, "image_0", beyond, bytes_, layout=filled), picture=False)
    put("contiguous_huge", lambda f, g: f.array(g, "image_0", large, bytes_, layout=late), picture=False)
    put("contiguous_beyond", lambda f, g: f.array(g, "image_0", huge, bytes_, layout=late), picture=False)
    put("huge_chunk", lambda f, g: f.array(g, "image_0", (16, 16, 4), bytes_, layout=chunked(16384, 16384, 4), most=(UNLIMITED,) * 3), picture=False)
    put("many_chunks", lambda f, g: f.array(g, "image_0", (4096, 4096, 4), bytes_, layout=chunked(1, 1, 1)), picture=False)
    put("huge_pose", lambda f, g: f.array(g, "c2w_0", (2**30, 2**30), layout=late), pose=False)
    put("huge_fov", lambda f, g: f.array(g, "fov_0", (2**50,), layout=late), fov=False)
    put("no_size", lambda f, g: f.array(g, "image_0", (0, 16, 4), bytes_, layout=late), picture=False)
    put("many_sides", lambda f, g: f.array(g, "image_0", (1,) * number(9, 32), bytes_), picture=False)
    put("numbers", lambda f, g: f.array(g, "image_0", (16, 16, 4), choose(("H5T_NATIVE_FLOAT_g", "H5T_NATIVE_SHORT_g", "H5T_NATIVE_DOUBLE_g"))), picture=False)
    put("nan", lambda f, g: f.array(g, "c2w_0", (4, 4), data=(ctypes.c_float * 16)(*[choose((math.nan, math.inf))] * 16)), pose=False)
    put("wide_fov", lambda f, g: f.array(g, "fov_0", (2,), data=(ctypes.c_float * 2)(choose((0, -1, 9, math.nan)), 0.8)), fov=False)

    def variable(f, g):
        f.array(g, "image_0", (16, 16, 4), f.ID(f.H("H5Tvlen_create", f.H.constant(bytes_))))
    put("variable", variable, picture=False)

    def text(f, g):
        kind = f.ID(f.H("H5Tcopy", f.H.constant("H5T_C_S1_g")))
        f.H("H5Tset_size", kind, ctypes.c_size_t(number(1, 1000)), result=ctypes.c_int)
        f.array(g, "image_0", (16, 16, 4), kind)
    put("text", text, picture=False)

    def compound(f, g):
        kind = f.ID(f.H("H5Tcreate", 6, ctypes.c_size_t(8)))
        f.H("H5Tinsert", kind, b"a", ctypes.c_size_t(0), f.H.constant("H5T_NATIVE_FLOAT_g"), result=ctypes.c_int)
        f.array(g, "image_0", (16, 16, 4), kind)
    put("compound", compound, picture=False)

    def plugin(H, ID, made):
        chunked(16, 16, 4)(H, ID, made)
        # A filter that may be absent, so that it can be named without existing.
        H("H5Pset_filter", made, number(256, 32_000), ctypes.c_uint(1), ctypes.c_size_t(0), None, result=ctypes.c_int)
    try:
        put("plugin", lambda f, g: f.array(g, "image_0", (16, 16, 4), bytes_, layout=plugin), picture=False)
    except AssertionError:  # a library that requires the filter when the file is made
        pass

    # Values in other files.
    for kind, target in {**maker.outside(), "bait": "../../bait/bait.bin", "pipe": "pipe"}.items():
        def stored(H, ID, made, target=target):
            H("H5Pset_external", made, target.encode(), ctypes.c_int64(0), SIZE(16 * 16 * 4), result=ctypes.c_int)
        path = put(f"stored_{kind}", lambda f, g, stored=stored: f.array(g, "image_0", (16, 16, 4), bytes_, layout=stored), picture=False)
        if kind == "pipe":
            os.mkfifo(os.path.join(os.path.dirname(path), "pipe"))
    for kind, target in {**maker.outside(), "bait": "../../bait/bait.h5", "pipe": "pipe.h5", "missing": maker.word() + ".h5", "escape": maker.escape()}.items():
        path = put(f"link_{kind}", lambda f, g, target=target: f.external(target, "/object/image_0", g, "image_0"), picture=False)
        if kind == "pipe":
            os.mkfifo(os.path.join(os.path.dirname(path), "pipe.h5"))
        put(f"group_{kind}", lambda f, g, target=target: f.external(target, "/object", f.file, "aside"))
    for kind, target in (("bait", "../../bait/bait.h5"), ("passwd", "/etc/passwd"), ("self", ".")):
        def virtual(H, ID, made, target=target):
            space = ID(H("H5Screate_simple", 3, sizes((16, 16, 4)), None))
            H("H5Pset_virtual", made, space, target.encode(), b"/object/image_1", space, result=ctypes.c_int)
        put(f"virtual_{kind}", lambda f, g, virtual=virtual: f.array(g, "image_0", (16, 16, 4), bytes_, layout=virtual), picture=False)

    # Links within the file.
    put("soft_nowhere", lambda f, g: f.soft("/" + maker.word(), g, "image_0"), picture=False)
    put("soft_loop", lambda f, g: f.soft("/object/image_0", g, "image_0"), picture=False)
    put("soft_up", lambda f, g: f.soft("../../../../etc/passwd", g, "image_0"), picture=False)
    put("group_loop", lambda f, g: f.H("H5Lcreate_hard", f.file, b"/", g, b"again", f.ID(0), f.ID(0), result=ctypes.c_int))
    put("group_for_array", lambda f, g: f.H("H5Gclose", f.ID(f.H("H5Gcreate2", g, b"image_0", f.ID(0), f.ID(0), f.ID(0))), result=ctypes.c_int), picture=False)
    put("array_for_group", lambda f, g: f.array(f.file, "aside", (4,)))
    put("escape", lambda f, g: f.H("H5Gclose", f.group(maker.escape().replace("/", "-")), result=ctypes.c_int))
    put("no_utf8", lambda f, g: f.H("H5Gclose", f.group(b"\xff\xfe\x80"), result=ctypes.c_int))
    put("far_index", lambda f, g: f.view(g, choose((99_999, 100_000, 2**31))))
    put("many_groups", lambda f, g: [f.H("H5Gclose", f.group(f"g{i}"), result=ctypes.c_int) for i in range(number(2000, 4000))])
    source = put("sound", None)
    with open(source, "rb") as f:
        sound = f.read()
    maker.file("hdf5/cut", "hdf5", maker.word() + ".h5", sound[:number(9, len(sound) - 1)])
    for i in range(8):
        spoilt = bytearray(sound)
        for _ in range(number(1, 12)):
            at = number(0, len(spoilt) - 8)
            spoilt[at:at + choose((1, 2, 4, 8))] = bytes(choose((0, 255, number(0, 255))) for _ in range(choose((1, 2, 4, 8))))
        maker.file(f"hdf5/spoilt{i}", "hdf5", maker.word() + ".h5", bytes(spoilt))
    maker.file("hdf5/zero_bytes", "hdf5", maker.word() + ".h5", b"\x89HDF\r\n\x1a\n" + b"\0" * number(10, 5000))


