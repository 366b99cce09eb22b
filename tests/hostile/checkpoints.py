"""PyTorch checkpoints: pickles that would run something, tensors outside their storages, invalid archives. Made from committed ones, so
PyTorch is not needed."""
import io
import os
import pickle
import re
import struct
import subprocess
import zipfile
import zlib

GOLDEN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "golden")


def zipped(entries, method=zipfile.ZIP_STORED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as z:
        for name, content in entries:
            z.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content, method)
    return out.getvalue()


class Canary:
    """If Python unpickled it, it would make a file."""
    def __init__(self, path, call=os.system):
        self.path, self.call = path, call

    def __reduce__(self):
        if self.call in (eval, exec):
            return self.call, (f"open({self.path!r}, 'w')",)
        return self.call, (["touch", self.path] if self.call is subprocess.check_call else f"touch {self.path}",)


class Broken:
    """Files made from a sound checkpoint. canary: a file that the pickle would make if it were run."""
    def __init__(self, path, canary, rng):
        self.canary, self.random = canary, rng
        with zipfile.ZipFile(path) as z:
            self.entries = [(i.filename, z.read(i)) for i in z.infolist()]
        self.top = self.entries[0][0].split("/")[0]
        self.pickle = dict(self.entries)[f"{self.top}/data.pkl"]
        with open(path, "rb") as f:
            self.whole = f.read()

    def with_pickle(self, data):
        return zipped([(name, data if name.endswith("data.pkl") else content) for name, content in self.entries])

    def hostile_pickles(self):
        """Yields a description and the bytes."""
        for call in (os.system, eval, exec, subprocess.check_call, os.popen):
            danger = Canary(self.canary, call)
            for place in ({"state_dict": danger}, {"state_dict": {"net.div_offset": danger}}, {"state_dict": {}, "callbacks": [danger]}, danger, [danger]):
                yield f"{call.__name__} {type(place).__name__}", pickle.dumps(place, 2)
            yield f"{call.__name__} 4", pickle.dumps(danger, 4)
            # Things that a reader would call before it sees the rest, and in places that it does not examine.
            yield f"{call.__name__} before", b"\x80\x02" + pickle.dumps(danger, 2)[2:-1] + b"0" + self.pickle[2:]
            yield f"{call.__name__} in a list", b"\x80\x02]" + pickle.dumps(danger, 2)[2:-1] + b"a" + self.pickle[2:]
        touch = b"X" + struct.pack("<I", len(self.canary) + 6) + b"touch " + self.canary.encode()
        for name, code in (("inst", b"(" + touch + b"ios\nsystem\n."), ("obj", b"(cos\nsystem\n" + touch + b"o."), ("stack", b"\x8c\x02os\x8c\x06system\x93" + touch + b"\x85R."),
                           ("newobj", b"cos\nsystem\n" + touch + b"\x85\x81."), ("ext", b"\x82\x01" + touch + b"\x85R."), ("persid", b"Pos.system\n."),
                           ("getattr", b"c__builtin__\ngetattr\n."), ("import", b"c__builtin__\n__import__\n."), ("twice", b"ccollections\nOrderedDict\n)R" + touch + b"\x85R."),
                           ("call a text", touch + touch + b"\x85R."), ("call a storage", b"ctorch\nFloatStorage\n" + touch + b"\x85R."),
                           ("build a text", touch + b"}b."), ("no mark", b"t."), ("no value", b"."), ("two values", b"NN."), ("get", b"h\x05."), ("put far", b"Nr\xff\xff\xff\xff."),
                           ("long text", b"X\xff\xff\xff\xff."), ("long", b"\x8a\xff" + b"\x01" * 255 + b"."), ("long4", b"\x8b\xff\xff\xff\x7f."), ("open", b"}q\0("), ("self", b"}q\0h\0h\0s."),
                           ("deep tuples", b"N" + b"\x85" * 1_000_000 + b"."), ("deep lists", b"]" * 600_000 + b"a" * 599_999 + b"."), ("marks", b"(" * 2_000_000 + b"."),
                           ("many", b"(" + b"N" * 3_000_000 + b"t."), ("same", b"]q\0(" + b"h\0" * 6_000_000 + b"e."), ("escape", b"c\x1b]0;owned\x07\n\x9b2J\n.")):
            yield name, b"\x80\x02" + code

    def tensor_pickles(self):
        """State dicts whose tensors are outside their storages, and storages in other places."""
        def number(n):
            return b"\x8a\x08" + struct.pack("<q", n)
        def sides(values):
            return b"(" + b"".join(map(number, values)) + b"t"
        def text(word):
            return b"X" + struct.pack("<I", len(word)) + word.encode()
        def state(kind="FloatStorage", key="0", count=6, offset=0, shape=(2, 3), strides=(3, 1), tag="storage"):
            storage = b"(" + text(tag) + b"ctorch\n" + kind.encode() + b"\n" + text(key) + text("cpu") + number(count) + b"tQ"
            return (b"\x80\x02}" + text("net.encoder.model.cls_token") + b"ctorch._utils\n_rebuild_tensor_v2\n(" + storage + number(offset) + sides(shape) + sides(strides)
                    + b"\x89ccollections\nOrderedDict\n)RtRs.")
        big = 2**62
        for name, change in (("offset", {"offset": 1}), ("offset far", {"offset": big}), ("offset before", {"offset": -1}), ("stride", {"strides": (4, 1)}),
                             ("stride before", {"strides": (-3, 1)}), ("shape", {"shape": (3, 3)}), ("shape far", {"shape": (big, big)}), ("expanded", {"shape": (big, 8), "strides": (0, 0)}),
                             ("shape before", {"shape": (-2, -3)}), ("ranks", {"strides": (1,)}), ("sides", {"shape": (1,) * 20, "strides": (1,) * 20}), ("count", {"count": 7}),
                             ("count far", {"count": big}), ("count before", {"count": -1}), ("key", {"key": "../../../etc/passwd"}), ("key absolute", {"key": "/etc/passwd"}),
                             ("no key", {"key": ""}), ("no entry", {"key": "99999"}), ("kind", {"kind": "QInt8Storage"}), ("kind of another module", {"kind": "load"}), ("tag", {"tag": "module"}),
                             ("size", {"kind": "DoubleStorage"})):
            entries = [(f"{self.top}/data.pkl", state(**change)), (f"{self.top}/data/0", b"\0" * 24)]
            yield name, zipped(entries)

    def archives(self):
        entries = self.entries
        pickled = (f"{self.top}/data.pkl", self.pickle)
        outside = os.path.relpath(self.canary, "/")
        for name in (f"../{outside}", "../" * 20 + outside, self.canary, f"{self.top}/../{outside}", f"{self.top}/data/../../x", "..", f"{self.top}\\..\\x", f"{self.top}/\x1b[2J", f"{self.top}//x",
                     "./x"):
            yield f"name {name!r}", zipped([*entries, (name, b"x")])
        yield "only outside", zipped([("../data.pkl", self.pickle), *entries[1:]])
        yield "two pickles", zipped([*entries, ("other/data.pkl", self.pickle)])
        yield "no pickle", zipped(entries[1:])
        unordered = [(name, content) for name, content in entries if name != f"{self.top}/byteorder"]
        yield "big", zipped([*unordered, (f"{self.top}/byteorder", b"big")])
        yield "byteorder", zipped([*unordered, (f"{self.top}/byteorder", b"x" * 100_000)])
        yield "twice", zipped([*entries, entries[-1]])
        yield "deflated", zipped(entries, zipfile.ZIP_DEFLATED)
        yield "bomb in the pickle", zipped([(pickled[0], b"\x80\x02" + b"N" * 200_000_000)], zipfile.ZIP_DEFLATED)
        yield "bomb in an entry", zipped([*entries, (f"{self.top}/data/99999", b"\0" * 200_000_000)], zipfile.ZIP_DEFLATED)
        # Sizes without data behind them, in the directory and in the entries' headers.
        for claim in (2**31, 2**32 - 2, 2**32 - 1):
            data = bytearray(zipped(entries))
            for mark, at in ((b"PK\x01\x02", 20), (b"PK\x03\x04", 18)):
                begin = data.find(mark)
                data[begin + at:begin + at + 8] = struct.pack("<II", claim, claim)
            yield f"claims {claim}", bytes(data)
        # Every entry at the place of the first: together they are larger than the file.
        data = bytearray(zipped([(f"{self.top}/data/{i}", b"\0" * 50_000) for i in range(3)] + [pickled]))
        at = -1
        while (at := data.find(b"PK\x01\x02", at + 1)) >= 0:
            data[at + 42:at + 46] = struct.pack("<I", 0)
        yield "overlap", bytes(data)
        data = bytearray(zipped(entries))
        for mark, at in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):  # all are marked as encrypted
            begin = -1
            while (begin := data.find(mark, begin + 1)) >= 0:
                data[begin + at] |= 1
        yield "encrypted", bytes(data)
        yield "a picture", zlib.compress(b"x" * 1000)
        yield "end alone", b"PK\x05\x06" + b"\0" * 18
        yield "entries without number", b"PK\x05\x06\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff\0\0\0\0\0\0"
        yield "pickle of another", zipped([(f"{self.top}/data.pkl", pickle.dumps({"state_dict": {"a": [1.5, "x"]}}, 2))])

    def certain(self):
        """Yields a description and the bytes; all of them must be refused."""
        yield from ((name, self.with_pickle(data)) for name, data in self.hostile_pickles())
        yield from self.tensor_pickles()
        yield from self.archives()

    def cut(self):
        return self.whole[:self.random.randrange(len(self.whole))]

    def spoilt(self):
        """Changes some bits. The file may still be valid: dates and padding are not read."""
        data = bytearray(self.whole)
        for _ in range(self.random.choice((1, 1, 2, 8))):
            data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        return bytes(data)


def make(maker):
    """Each kind, made from one of the committed checkpoints in turn; some kinds from an encoder's."""
    canary = os.path.join(maker.out, "bait", "touched")
    put = lambda role, name, data: maker.file(f"{role}/{re.sub('[^a-z0-9]+', '_', name.lower())[:24]}", role, maker.word() + ".ckpt", data)
    sources = [Broken(os.path.join(GOLDEN, f"{system}_micro.ckpt"), canary, maker.random) for system in ("lara", "genden")]
    for i, of_both in enumerate(zip(*(source.certain() for source in sources), strict=True)):
        name, data = of_both[(i + maker.random.randrange(2)) % 2]
        put("checkpoint", name, data)
    for i in range(8):
        put("checkpoint", f"cut {i}", sources[i % 2].cut())
        put("checkpoint", f"spoilt {i}", sources[i % 2].spoilt())
    encoder = Broken(os.path.join(GOLDEN, "dinov3_micro_timm.pth"), canary, maker.random)
    for name, data in maker.random.sample(list(encoder.certain()), 12):
        put("encoder", name, data)
