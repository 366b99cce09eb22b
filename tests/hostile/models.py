"""Files of tensors: models, checkpoints of trainings and of fits, encoders, LPIPS networks."""
import hashlib
import json
import os
import struct

from texts import nested


def parts(path):
    with open(path, "rb") as f:
        data = f.read()
    size = struct.unpack("<Q", data[:8])[0]
    return json.loads(data[8:8 + size]), data[8 + size:]


def whole(header, body):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + bytes(body)


def stated(header, body):
    """The file with its own hash corrected, so that damage to it is not detected by the hash."""
    header["__metadata__"]["sha256"] = "0" * 64
    header["__metadata__"]["sha256"] = hashlib.sha256(whole(header, body)).hexdigest()
    return whole(header, body)


def tensors(header):
    return sorted(name for name in header if name != "__metadata__")


def broken(maker, sound):
    """Yields kind and content, for any kind of tensor file of which `sound` is a good one."""
    choose = maker.random.choice
    head, body = parts(sound)
    head["__metadata__"].pop("sha256", None)
    data = whole(head, body)
    fresh = lambda: json.loads(json.dumps(head))
    one = lambda: fresh()[choose(tensors(head))]
    yield "nested", whole(nested(maker).encode(), body)
    yield "nested_metadata", whole(b'{"__metadata__": ' + nested(maker).encode() + b"}", body)
    yield "cut_header", data[:maker.random.randint(9, 300)]
    yield "cut_body", data[:-maker.random.randint(1, len(body))]
    yield "too_long", data + b"\0" * maker.random.randint(1, 1000)
    yield "huge_header", struct.pack("<Q", choose((2**63, 2**64 - 1, 10**8, 10**8 + 1, len(data)))) + data[8:]
    yield "empty", b""
    yield "zero_bytes", b"\0" * maker.random.randint(1, 100_000)
    for kind, spoil in (("huge_shape", {"shape": [2**62, 2**62]}), ("huge_empty_shape", {"shape": [0, 2**62, 2**62], "data_offsets": [0, 0]}),
                        ("negative_shape", {"shape": [-1, -4]}), ("huge_offsets", {"data_offsets": [2**63 - 8, 2**63 - 4]}),
                        ("backward_offsets", {"data_offsets": [64, 0]}), ("unknown_dtype", {"dtype": maker.escape()}),
                        ("wide_shape", {"shape": [1] * maker.random.randint(100_000, 300_000)}), ("kinds", {"shape": {"a": 1}, "dtype": 7})):
        header = fresh()
        header[choose(tensors(header))].update(spoil)
        yield kind, whole(header, body)
    header = fresh()
    name = choose(tensors(header))
    yield "twice", whole(json.dumps(header).replace("{", '{"%s": %s, ' % (name, json.dumps(header[name])), 1).encode(), body)
    header = fresh()
    first, second = tensors(header)[:2]
    header[first]["data_offsets"], header[first]["shape"] = header[second]["data_offsets"], header[second]["shape"]
    yield "overlap", whole(header, body)
    header = fresh()
    header[maker.escape() + "tensor"] = header.pop(choose(tensors(header)))
    yield "escape_name", whole(header, body)
    header = fresh()
    header["__metadata__"].update({"origin" + maker.escape(): maker.escape(), "format": choose((maker.escape(), header["__metadata__"]["format"]))})
    yield "escape_metadata", whole(header, body)
    header = fresh()
    for i in range(maker.random.randint(30_000, 60_000)):
        header[f"t{i}"] = {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}
    yield "many_tensors", whole(header, body)
    yield "no_utf8", data[:8] + data[8:].replace(b'"__metadata__"', b'"__met\xff\xfe\xfd__"', 1)


def spoilt(maker, sound, value):
    """One value is NaN, and the hash is valid."""
    header, body = parts(sound)
    body = bytearray(body)
    entry = header[maker.random.choice(tensors(header))]
    begin, end = entry["data_offsets"]
    at = begin + 4 * maker.random.randrange((end - begin) // 4)
    body[at:at + 4] = struct.pack("<f", value)
    return stated(header, body)


def configured(sound, change):
    header, body = parts(sound)
    config = json.loads(header["__metadata__"]["config"])
    change(config)
    header["__metadata__"]["config"] = json.dumps(config)
    return stated(header, body)


FIELDS = {  # of LaRa's, GenDen's and the densifier's configurations: large and invalid values
    "lara": (("volume", "feature_volume", "layers", "view_slots", "primitives", "volume_ch", "out_ch", "fine_hidden"), ("windows", "kind", "offset_cells", "rebase")),
    "genden": (("volume", "layers", "densify.top_k", "densify.channels", "densify.frequencies", "densify.mlp_ratio"),
               ("densify.cell", "densify.orders", "densify.depths", "densify.patch", "densify.upscale", "densify.duplicates", "densify.heads")),
    "vsplat+genden": (("volume", "fine_dim", "densify.top_k", "densify.heads"), ("densify.cell", "densify.upscale", "densify.opacity_threshold", "levels")),
}


def systems(maker, put):
    """Models of the other networks: invalid fields, and models that claim another architecture."""
    choose = maker.random.choice
    for name, (sizes, others) in FIELDS.items():
        sound = os.path.join(maker.sound, name + ".safetensors")
        kind = name.replace("+", "_") + "_"
        put(kind + "nan", spoilt(maker, sound, float("nan")))
        put(kind + "beyond", spoilt(maker, sound, choose((3e38, -3e38))))
        for field in sizes:
            put(f"{kind}huge_{field}", configured(sound, lambda c: c.update({field: choose((2**14, 2**20, 2**31 - 1, 2**40))})))
            put(f"{kind}negative_{field}", configured(sound, lambda c: c.update({field: choose((0, -1, -2**31))})))
        for field in others:
            value = choose((maker.escape(), -1, 0, 1e-30, 1e30, [], "2,2,2,2,2,2,2,2", {"a": 1}, None))
            put(f"{kind}other_{field}", configured(sound, lambda c: c.update({field: value})))
        for other in (maker.escape(), "vsplat", choose(sorted(FIELDS.keys() - {name})), ""):
            header, body = parts(sound)
            header["__metadata__"]["system"] = other
            put(kind + "system", stated(header, body))


def make(maker):
    micro = os.path.join(maker.sound, "micro.safetensors")
    choose = maker.random.choice
    put = lambda kind, value: maker.file(f"model/{kind}", "model", maker.word() + ".safetensors", value)
    for kind, content in broken(maker, micro):
        put(kind, content)
    put("nan", spoilt(maker, micro, float("nan")))
    put("infinite", spoilt(maker, micro, choose((float("inf"), float("-inf")))))
    put("beyond", spoilt(maker, micro, choose((3e38, -3e38))))
    put("huge_picture", configured(micro, lambda c: c.update(image=choose((4096, 8192)))))
    put("huge_volume", configured(micro, lambda c: c.update(volume=256)))
    put("huge_fields", configured(micro, lambda c: c.update({choose(("vit_dim", "vit_depth", "voxel_ch", "fine_dim")): 16384})))
    put("negative_fields", configured(micro, lambda c: c.update({choose(("views", "image", "volume", "groups")): choose((-1, 0, 2**40))})))
    put("escape_fields", configured(micro, lambda c: c.update({choose(("levels", maker.escape())): maker.escape()})))
    header, body = parts(micro)
    header["__metadata__"]["config"] = nested(maker)
    put("nested_config", stated(header, body))
    header, body = parts(micro)
    header["__metadata__"]["sha256"] = choose(("0" * 64, maker.escape(), "f" * 63, ""))
    put("wrong_hash", whole(header, body))

    systems(maker, put)

    # A run's folder whose only checkpoint is damaged, and the state of a fit.
    run = os.path.join(maker.sound, "run")
    checkpoint = sorted(name for name in os.listdir(run) if name.startswith("checkpoint-"))[-1]
    for role, name, sound in (("run", checkpoint, os.path.join(run, checkpoint)), ("state", "refinement.safetensors", os.path.join(maker.sound, "state", "refinement.safetensors"))):
        for kind, content in list(broken(maker, sound)) + [("nan", spoilt(maker, sound, float("nan")))]:
            folder = maker.folder(f"{role}/{kind}")
            maker.write(os.path.join(folder, name), content)
            maker.add(f"{role}/{kind}", role, folder, name)
    for kind, content in broken(maker, micro):
        if kind in ("nested", "huge_shape", "huge_header", "escape_name", "cut_body", "escape_metadata", "huge_empty_shape"):
            maker.file(f"encoder/{kind}", "encoder", maker.word() + ".safetensors", content)
            folder = maker.folder(f"lpips/{kind}")
            maker.write(os.path.join(folder, "alex.safetensors"), content)
            maker.add(f"lpips/{kind}", "lpips", folder, "alex.safetensors")
