"""Scenes in other formats than plain PLY: SPZ, .splat, PlayCanvas compressed PLY, SOG, glTF."""
import base64
import gzip
import io
import json
import pathlib
import struct
import zipfile

GOLDEN = pathlib.Path(__file__).resolve().parent.parent / "golden"


def spz_streams(count, degree=1, version=4):
    sizes = [6 if version == 1 else 9, 1, 3, 3, 3 if version < 3 else 4, 3 * ((degree + 1) ** 2 - 1)]
    return [bytes(size * count) for size in sizes]


def spz_head(version, count, degree=1, bits=12, flags=0):
    return struct.pack("<4sIIBBB", b"NGSP", version, count, degree, bits, flags)


def zstd(data):
    """A frame of blocks that repeat one byte: the shortest there are (RFC 8878)."""
    out, left = struct.pack("<IBQ", 0xFD2FB528, 0xE0, len(data)), len(data)
    while left > 0:
        size = min(left, 128 << 10)
        left -= size
        out += struct.pack("<I", size << 3 | 1 << 1 | (left == 0))[:3] + data[:1]
    return out


def new_spz(count, degree=1, bits=12, flags=0, records=b"", table=None, streams=None, claims=None):
    streams = [s for s in spz_streams(count, degree) if s] if streams is None else streams
    packed = [zstd(s) for s in streams]
    sizes = [(len(p), len(s)) for p, s in zip(packed, streams)] if claims is None else claims
    head = spz_head(4, count, degree, bits, flags) + struct.pack("<BI", len(sizes), 32 + len(records) if table is None else table) + bytes(12)
    return head + records + b"".join(struct.pack("<QQ", *s) for s in sizes) + b"".join(packed)


def old_spz(version, count, degree=1, bits=12, flags=0, body=None):
    return gzip.compress(spz_head(version, count, degree, bits, flags) + b"\0" + (b"".join(spz_streams(count, degree, version)) if body is None else body))


def spzs(maker):
    choose, number = maker.random.choice, maker.random.randint
    put = lambda kind, value: maker.file(f"spz/{kind}", "scene", maker.word() + ".spz", value)
    sound = new_spz(number(3, 50), choose((0, 1, 4)))
    many = number(2 ** 30, 2 ** 32 - 1)
    put("cut", sound[:number(1, len(sound) - 1)])
    put("cut_old", old_spz(choose((1, 2, 3)), 9)[:number(3, 60)])
    put("count", spz_head(4, many) + new_spz(5)[15:])
    put("count_old", old_spz(choose((1, 2, 3)), many, body=bytes(100)))
    put("count_not_held", new_spz(5, claims=[(10, 9 * 2 ** 30)] + [(10, 5)] * 5))
    put("bomb_old", gzip.compress(spz_head(2, 2 ** 31 - 1) + bytes(number(30_000_000, 60_000_000)), 9))
    put("bomb", new_spz(number(3_000_000, 5_000_000), 4))
    put("stream_beyond", new_spz(5, claims=[(choose((2 ** 63, 2 ** 64 - 1, 2 ** 32)), 45)] + [(10, 5)] * 5))
    put("table_beyond", new_spz(5, table=choose((0, 31, 2 ** 31, 2 ** 32 - 1))))
    put("streams", new_spz(5, streams=[bytes(45)] * choose((1, 5, 7, 255))))
    put("empty", new_spz(0, streams=[]))
    put("version", spz_head(choose((0, 5, 2 ** 31, 2 ** 32 - 1)), 5) + new_spz(5)[15:])
    put("degree", spz_head(4, 5, choose((5, 200, 255))) + new_spz(5)[15:])
    put("bits", new_spz(5, bits=choose((25, 31, 63, 255))))
    put("record", new_spz(5, flags=2, records=struct.pack("<II", 0xADBE0003, choose((3, 2 ** 31, 2 ** 32 - 1)))))
    put("frame", new_spz(5, flags=2, records=struct.pack("<III", 0xADBE0003, 4, choose((0, 9, 16, 2 ** 32 - 1)))))
    put("records_old", old_spz(3, 5, flags=2, body=b"".join(spz_streams(5, 1, 3)) + bytes(number(1, 7))))
    put("not_finite", old_spz(1, 4, body=struct.pack("<12H", *[choose((0x7e00, 0x7c00, 0xfc00)) for _ in range(12)]) + bytes(4 * 19)))
    put("no_gzip", b"\x1f\x8b" + bytes(number(0, 255) for _ in range(200)))
    put("other_gzip", gzip.compress(maker.escape().encode("utf-8", "surrogateescape") * 20))
    put("zeros", b"NGSP" + bytes(number(1, 1000)))


def splats(maker):
    choose, number = maker.random.choice, maker.random.randint
    put = lambda kind, value: maker.file(f"splat/{kind}", "scene", maker.word() + ".splat", value)
    row = lambda *values, rotation=(255, 128, 128, 128): struct.pack("<6f8B", *values, 128, 128, 128, 255, *rotation)
    good = row(0, 0, 0, 0.1, 0.1, 0.1)
    put("size", (good * 5)[:number(33, 159)])
    put("empty", b"")
    put("not_finite", good * 2 + row(*(choose((float("nan"), float("inf"), -float("inf"))) for _ in range(6))))
    put("negative", good + row(0, 0, 0, -1, 0.1, 0.1))
    put("no_rotation", good + row(0, 0, 0, 0.1, 0.1, 0.1, rotation=(128,) * 4))
    put("huge", good + row(3e38, -3e38, 3e38, 3e38, 3e38, 3e38))
    put("noise", bytes(number(0, 255) for _ in range(32 * number(1, 100))))


def compressed_plys(maker):
    choose, number = maker.random.choice, maker.random.randint
    put = lambda kind, value: maker.file(f"compressed_ply/{kind}", "scene", maker.word() + ".compressed.ply", value)
    bounds = [f"{end}_{group}{axis}" for group in ("", "scale_") for end in ("min", "max") for axis in "xyz"]

    def made(count=5, chunks=1, sh=None, rows=None, chunk=None, names=bounds, rest=9):
        head = f"ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n" + "".join(f"property float {n}\n" for n in names)
        head += f"element vertex {count}\n" + "".join(f"property uint packed_{n}\n" for n in ("position", "rotation", "scale", "color"))
        head += "" if sh is None else f"element sh {sh}\n" + "".join(f"property uchar f_rest_{i}\n" for i in range(rest))
        body = struct.pack(f"<{len(names)}f", *([0.5] * len(names) if chunk is None else chunk)) + bytes(16 * 5 if rows is None else rows)
        return head.encode() + b"end_header\n" + body + (b"" if sh is None else bytes(rest * 5))

    put("count", made(count=number(2 ** 31, 2 ** 62), chunks=number(2 ** 24, 2 ** 50)))
    put("chunks", made(chunks=choose((0, 2, 2 ** 40))))
    put("sh_rows", made(sh=choose((0, 4, 6, 2 ** 40))))
    put("sh_values", made(sh=5, rest=choose((1, 10, 44))))
    put("cut", made(rows=number(0, 79)))
    put("not_finite", made(chunk=[choose((float("nan"), float("inf"), -float("inf"))) for _ in bounds]))
    put("scale", made(chunk=[0] * 6 + [100, 3e38, 88.8] * 2))
    put("no_bounds", made(names=bounds[:number(1, 11)]))
    put("no_chunk", made().replace(b"element chunk", b"element other"))
    put("twice", made().replace(b"element vertex", b"element chunk 1\nproperty float min_x\nelement vertex"))


def golden(folder, ending):
    return (GOLDEN / folder / sorted(p.name for p in (GOLDEN / folder).iterdir() if p.name.endswith(ending))[0]).read_bytes()


def sogs(maker):
    choose, number = maker.random.choice, maker.random.randint
    put = lambda kind, value: maker.file(f"sog/{kind}", "scene", maker.word() + ".sog", value)
    sound = golden("sog", ".sog")
    with zipfile.ZipFile(io.BytesIO(sound)) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    meta = json.loads(entries["meta.json"])

    def zipped(files, how=zipfile.ZIP_STORED):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", how) as archive:
            for name, content in files.items():
                archive.writestr(name, content)
        return out.getvalue()

    def changed(change):
        other = json.loads(json.dumps(meta))
        change(other)
        return zipped({**entries, "meta.json": json.dumps(other)})

    put("cut", sound[:number(30, len(sound) - 1)])
    put("count", changed(lambda m: m.update(count=number(2 ** 20, 2 ** 62))))
    put("count_kind", changed(lambda m: m.update(count=choose((-1, 0, 1.5, "7", None, [7])))))
    put("version", changed(lambda m: m.update(version=choose((0, 3, -1, "2", 2 ** 40)))))
    for part in ("means", "scales", "quats", "sh0"):
        put(f"no_{part}", changed(lambda m: m.pop(part)))
        put(f"files_{part}", changed(lambda m: m[part].update(files=choose(([], ["../../etc/passwd"], ["gone.webp"] * 2, [7, 7], "x")))))
    put("codebook", changed(lambda m: m["scales"].update(codebook=choose(([], [0.0] * 255, [1e400] * 256, ["x"] * 256)))))
    put("bounds", changed(lambda m: m["means"].update(mins=choose(([0, 0], [1e400] * 3, [0, None, 0])))))
    plane = choose([name for name in entries if name.endswith(".webp")])
    put("no_plane", zipped({name: content for name, content in entries.items() if name != plane}))
    put("bad_plane", zipped({**entries, plane: bytes(number(0, 255) for _ in range(number(0, 300)))}))
    put("cut_plane", zipped({**entries, plane: entries[plane][:number(0, len(entries[plane]) - 1)]}))
    put("meta_bomb", zipped({**entries, "meta.json": b" " * number(50_000_000, 80_000_000)}, zipfile.ZIP_DEFLATED))
    put("meta_text", zipped({**entries, "meta.json": maker.escape().encode("utf-8", "surrogateescape") + b"{"}))


def gltfs(maker):
    choose, number = maker.random.choice, maker.random.randint
    sound = golden("gltf", ".glb")
    length = struct.unpack_from("<I", sound, 12)[0]
    document, data = json.loads(sound[20:20 + length]), sound[20 + length + 8:]

    def glb(text, chunk=data, version=2, size=None):
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(chunk), b"BIN\0") + chunk
        return struct.pack("<4sII", b"glTF", version, 12 + len(body) if size is None else size) + body

    def put(kind, change=lambda d: None, **how):
        other = json.loads(json.dumps(document))
        change(other)
        maker.file(f"glb/{kind}", "scene", maker.word() + ".glb", glb(json.dumps(other).encode(), **how))
        other["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(how.get("chunk", data)).decode()
        maker.file(f"gltf/{kind}", "scene", maker.word() + ".gltf", json.dumps(other).encode())

    maker.file("glb/cut", "scene", maker.word() + ".glb", sound[:number(13, len(sound) - 1)])
    put("size", size=choose((0, 12, 2 ** 32 - 1)))
    put("version", version=choose((0, 1, 3, 2 ** 31)))
    put("cut_buffer", chunk=data[:number(0, len(data) - 1)])
    put("count", lambda d: choose(d["accessors"]).update(count=choose((0, -1, 2 ** 31, 2 ** 62, "7", 1.5))))
    put("offset", lambda d: choose(d["bufferViews"]).update(byteOffset=choose((-4, 1, 2 ** 31, 2 ** 62))))
    put("stride", lambda d: choose(d["bufferViews"]).update(byteStride=choose((0, 3, 2 ** 31))))
    put("kind", lambda d: choose(d["accessors"]).update(type=choose(("SCALAR", "MAT4", 7)), componentType=choose((5120, 5125, 7))))
    put("index", lambda d: d["nodes"][0].update(mesh=choose((-1, 7, 2 ** 40, "x"))))
    put("loop", lambda d: d["nodes"].append({"children": [len(d["nodes"])]}) or d["scenes"][0].update(nodes=[len(d["nodes"]) - 1]))
    put("matrix", lambda d: d["nodes"][0].update(matrix=choose(([0] * 16, [1e400] * 16, [1] * 15, [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]))))
    put("sparse", lambda d: d["accessors"][0].update(sparse={"count": 1}))
    put("required", lambda d: d.update(extensionsRequired=[maker.word()]))

    def many(d):  # a mesh of many primitives in many nodes
        d["meshes"] = [{"primitives": d["meshes"][0]["primitives"][:1] * 3000}]
        d["nodes"] = [{"mesh": 0}] * 3000
        d["scenes"][0]["nodes"] = list(range(3000))
    put("many_nodes", many)
    put("many_buffers", lambda d: d.update(buffers=d["buffers"] + [{"uri": "a.bin", "byteLength": 4}] * 3000))


def make(maker):
    spzs(maker)
    splats(maker)
    compressed_plys(maker)
    sogs(maker)
    gltfs(maker)
