"""Configurations, selections and scenes: files that are text, or begin like it."""
import json
import struct


def nested(maker, least=20_000):
    depth = maker.random.randint(least, 10 * least)
    begin, end = maker.random.choice((("[", "]"), ('{"a":', "}")))
    return begin * depth + (end if begin == "[" else "0" + end) * depth if maker.random.random() < 0.5 else begin * depth


def configs(maker):
    choose = maker.random.choice
    put = lambda kind, value: maker.file(f"config/{kind}", "config", maker.word() + ".json", value if isinstance(value, (str, bytes)) else json.dumps(value))
    put("nested", nested(maker))
    put("nested_model", '{"model": ' + nested(maker) + "}")
    put("nested_field", '{"%s": %s}' % (choose(("extend", "steps", "stages", "frozen")), nested(maker)))
    put("huge_width", {"model": {"base": choose(("paper", "small")), "vit_dim": 16384, "vit_heads": choose((1, 16, 64)), "vit_depth": maker.random.randint(4, 64)}})
    put("huge_picture", {"model": {"base": "micro", "image": choose((2048, 8192)), "patch": choose((128, 256))}, "novel": 64, "inputs_max": 16, "alpha_weight": choose((0, 1))})
    put("huge_volume", {"model": {"base": "micro", "volume": 256, "fine_count": choose((2, 64, 127))}, "batch": 1024, "accumulate": 1024})
    put("huge_depth", {"model": {"base": "micro", "vit_depth": 256, "voxel_levels": 64, "volume_mult": [1, 64, 64], "volume_ch": 4096}})
    put("beyond", '{"steps": %s}' % choose(("1e999", "-1", "1e308", "18446744073709551616", "9" * 5000, "1.5", "NaN", "-Infinity")))
    put("beyond_model", '{"model": {"%s": %s}}' % (choose(("image", "volume", "vit_dim", "patch", "views")), choose(("2147483648", "-2147483649", "1e300", "0", "-1"))))
    put("twice", '{"steps": 3, "lr": 0.1, "steps": %d}' % maker.random.randint(4, 9))
    put("escape", {choose(("fit", maker.escape())): maker.escape()})
    put("escape_model", {"model": choose((maker.escape(), {maker.escape(): 1}, {"base": maker.escape()}, {"levels": maker.escape()}))})
    put("no_utf8", b'{"fit": "' + bytes(maker.random.randint(128, 255) for _ in range(50)) + b'"}')
    put("zero_bytes", b"\0" * maker.random.randint(1, 100_000))
    put("empty", "")
    put("long_string", {"fit": maker.word() * maker.random.randint(200_000, 400_000)})
    put("wide", {f"field{i}": i for i in range(maker.random.randint(50_000, 100_000))})
    put("long_list", {"extend": [1] * maker.random.randint(500_000, 1_000_000)})
    put("many_frozen", {"model": "micro", "frozen": ["encoder.", maker.word()] * maker.random.randint(100_000, 200_000)})
    put("many_stages", {"model": "micro", "stages": [{"steps": 1}] * maker.random.randint(101, 5000)})
    put("full_stages", {"model": "micro", "stages": [{"steps": i + 1} for i in range(100)]})
    put("cut", json.dumps({"model": "micro", "steps": 30, "batch": 1})[:maker.random.randint(1, 40)])


def selections(maker):
    put = lambda kind, value: maker.file(f"selection/{kind}", "selection", maker.word() + ".txt", value)
    put("escape", f"# ok\n0\n{maker.escape()}5\n")
    put("no_utf8", b"# c\xff\n0\n" + bytes(maker.random.randint(128, 255) for _ in range(30)) + b"\n")
    put("beyond", f"0\n{maker.random.choice(('64', '4294967296', '-1', '9' * 400, '1e3'))}\n")
    put("descending", "3\n2\n")
    put("zero_bytes", b"\0" * maker.random.randint(10, 5000))
    put("one_line", "1" * maker.random.randint(1_000_000, 8_000_000))
    put("many", "\n".join(map(str, range(maker.random.randint(400_000, 900_000)))))


NAMES = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]


def scene(count, rows=None, names=NAMES, extra="", ending="binary_little_endian"):
    head = f"ply\nformat {ending} 1.0\n{extra}element vertex {count}\n" + "".join(f"property float {n}\n" for n in names) + "end_header\n"
    rows = [[0.1 * i, 0, 0, 0.5, 0.1, 0.2, 1, -2, -2, -2, 1, 0, 0, 0] for i in range(3)] if rows is None else rows
    return head.encode("utf-8", "surrogateescape") + b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows)


def scenes(maker):
    put = lambda kind, value: maker.file(f"scene/{kind}", "scene", maker.word() + ".ply", value)
    sound = scene(3)
    huge = maker.random.choice((2**31 - 1, 2**32, 2**62, 2**63 - 1, 2**64 - 1, 10**30))
    put("huge_count", scene(huge))
    put("negative_count", scene(-maker.random.randint(1, 9)))
    put("cut_header", sound[:maker.random.randint(4, 150)])
    put("cut_body", sound[:-maker.random.randint(1, 100)])
    put("min", maker.random.choice((b"ply", b"ply\n", b"ply\nformat ascii 1.0\n", b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n")))
    row = [0.1, 0, 0, 0.5, 0.1, 0.2, 1, -2, -2, -2, 1, 0, 0, 0]
    for kind, value in (("nan", float("nan")), ("infinite", float("inf")), ("beyond", 3e38)):
        spoilt = list(row)
        spoilt[maker.random.randrange(14)] = value
        put(kind, scene(2, [row, spoilt]))
    put("huge_scale", scene(2, [row, row[:7] + [maker.random.choice((80.0, 500.0, 3e38))] * 3 + row[10:]]))
    put("no_rotation", scene(1, [row[:10] + [0, 0, 0, 0]]))
    flat = [name for name in NAMES if name != "scale_2"]
    of_two = lambda values: values[:9] + values[10:]
    whole = scene(2, [of_two(row)] * 2, names=flat)
    put("surfels_cut", whole[:-maker.random.randint(1, 100)])
    put("surfels_count", scene(huge, [of_two(row)], names=flat))
    for kind, at, value in (("nan", maker.random.randrange(13), float("nan")), ("huge_scale", maker.random.choice((7, 8)), maker.random.choice((80.0, 500.0, 3e38))),
                            ("point", maker.random.choice((7, 8)), maker.random.choice((-80.0, -500.0, -3e38)))):
        spoilt = of_two(row)
        spoilt[at] = value
        put(f"surfels_{kind}", scene(2, [of_two(row), spoilt], names=flat))
    put("surfels_no_rotation", scene(1, [of_two(row)[:9] + [0, 0, 0, 0]], names=flat))
    put("surfels_one_scale", scene(1, [of_two(row)[:8] + of_two(row)[9:]], names=[name for name in flat if name != "scale_1"]))
    put("huge_list", scene(3, extra=f"element face {maker.random.randint(1, 2**31 - 1)}\nproperty list uint int vertex_indices\n"))
    put("list_count", scene(3, extra="element face 1\nproperty list uint int vertex_indices\n").replace(b"end_header\n", b"end_header\n\xff\xff\xff\xff"))
    put("escape", scene(3, extra=f"comment {maker.escape()}\n".replace("\n", " ", 1) + f"element {maker.escape().strip()} 1\nproperty float x\n"))
    put("escape_property", scene(3, names=NAMES[:-1] + [maker.escape().replace("\n", "").replace(" ", "") or "q"]))
    put("many_properties", scene(3, extra="element other 1\n" + "".join(f"property float p{i}\n" for i in range(maker.random.randint(50_000, 90_000)))))
    put("long_line", b"ply\nformat ascii 1.0\ncomment " + b"x" * maker.random.randint(4_000_000, 8_000_000))
    put("text_junk", scene(3, [], ending="ascii") + b"1 2 " * maker.random.randint(10, 1000))
    put("zero_bytes", b"ply\n" + b"\0" * maker.random.randint(10, 100_000))
    put("twice", scene(3, extra="element vertex 3\nproperty float x\n"))


def make(maker):
    configs(maker)
    selections(maker)
    scenes(maker)
