#!/usr/bin/env python3
"""glTF files of random Gaussians (KHR_gaussian_splatting), and what they mean, from the specification alone.

  tests/golden/gltf_files.py DIR     writes glTF files and NAME.json with what is expected of them

Expected are, for each Gaussian in the axes of a scene (x right, y down, z forward: glTF's after a half turn about z): its centre, its
covariance, its opacity, and its colour from some directions, which do not depend on how rotations and coefficients are written. Needs numpy."""
import base64
import json
import math
import pathlib
import struct
import sys

import numpy as np

NAME = "KHR_gaussian_splatting"
HALF_TURN = np.diag([-1.0, -1.0, 1.0])
DIRECTIONS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-0.6, 0.8, 0], [0.48, -0.6, 0.64], [-2 / 3, -1 / 3, -2 / 3]])
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
COMPONENTS = {np.dtype("f4"): 5126, np.dtype("u1"): 5121, np.dtype("i1"): 5120, np.dtype("u2"): 5123, np.dtype("i2"): 5122}


def basis(d):
    """Real spherical harmonics with the Condon-Shortley phase, degrees 0 to 3, in the order of the extension."""
    x, y, z = d
    c1, c3 = math.sqrt(3 / (4 * math.pi)), math.sqrt(15 / (4 * math.pi))
    return np.array([math.sqrt(1 / (4 * math.pi)), -c1 * y, c1 * z, -c1 * x,
                     c3 * x * y, -c3 * y * z, math.sqrt(5 / (16 * math.pi)) * (3 * z * z - 1), -c3 * x * z, c3 / 2 * (x * x - y * y),
                     -math.sqrt(35 / (32 * math.pi)) * y * (3 * x * x - y * y), math.sqrt(105 / (4 * math.pi)) * x * y * z,
                     -math.sqrt(21 / (32 * math.pi)) * y * (5 * z * z - 1), math.sqrt(7 / (16 * math.pi)) * z * (5 * z * z - 3),
                     -math.sqrt(21 / (32 * math.pi)) * x * (5 * z * z - 1), math.sqrt(105 / (16 * math.pi)) * z * (x * x - y * y),
                     -math.sqrt(35 / (32 * math.pi)) * x * (x * x - 3 * y * y)])


def rotation(q):
    x, y, z, w = np.array(q) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def meaning(a):
    """Normalised integers as fractions."""
    return a.astype(float) if a.dtype == np.float32 else np.maximum(a.astype(float) / np.iinfo(a.dtype).max, -1)


def expected(columns, degree, turn, scale, shift):
    """What the Gaussians are after the node's transform, in a scene's axes."""
    out = {"degree": degree, "directions": DIRECTIONS.tolist(), "mean": [], "covariance": [], "opacity": [], "colour": []}
    whole = HALF_TURN @ turn
    for k in range(len(columns["POSITION"])):
        r = whole @ rotation(meaning(columns[f"{NAME}:ROTATION"][k]))
        s = np.diag(meaning(columns[f"{NAME}:SCALE"][k]) * scale)
        out["mean"].append((HALF_TURN @ (scale * turn @ columns["POSITION"][k].astype(float) + shift)).tolist())
        out["covariance"].append((r @ s @ s @ r.T).tolist())
        out["opacity"].append(float(meaning(columns[f"{NAME}:OPACITY"][k]).item()))
        coefficients = np.array([columns[f"{NAME}:SH_DEGREE_{d}_COEF_{i}"][k].astype(float) for d in range(degree + 1) for i in range(2 * d + 1)])
        # Seen from `d`, the turned Gaussian shows what it showed from the turned-back direction.
        out["colour"].append([(0.5 + basis(whole.T @ d)[: len(coefficients)] @ coefficients).tolist() for d in DIRECTIONS])
    return out


def columns_of(random, count, degree, rotations, scales, opacities):
    """`rotations` and so on: the types of these numbers."""
    q = random.normal(size=(count, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    as_type = lambda v, t: v.astype("f4") if t == "f4" else np.round(v * np.iinfo(t).max).astype(t)
    out = {"POSITION": random.normal(size=(count, 3)).astype("f4"), f"{NAME}:ROTATION": as_type(q, rotations),
           f"{NAME}:SCALE": as_type(random.uniform(0.01, 0.5, (count, 3)), scales),
           f"{NAME}:OPACITY": as_type(random.uniform(0, 1, (count, 1)), opacities)}
    for d in range(degree + 1):
        for i in range(2 * d + 1):
            out[f"{NAME}:SH_DEGREE_{d}_COEF_{i}"] = (random.normal(size=(count, 3)) * (0.8 if d == 0 else 0.2)).astype("f4")
    return out


def document(columns, node, interleaved=False):
    """The JSON without its buffer's uri, and the buffer. `interleaved`: all elements of a Gaussian beside each other."""
    accessors, views, parts, at = [], [], [], 0
    pad = lambda n: (n + 3) // 4 * 4
    stride = sum(pad(c.itemsize * c.shape[1]) for c in columns.values())
    count = len(columns["POSITION"])
    for name, c in columns.items():
        element = c.itemsize * c.shape[1]
        rows = np.zeros((count, pad(element)), np.uint8)
        rows[:, :element] = np.ascontiguousarray(c).view(np.uint8).reshape(count, element)
        accessor = {"componentType": COMPONENTS[c.dtype], "count": count, "type": TYPES[c.shape[1]]}
        if c.dtype != np.float32:
            accessor["normalized"] = True
        if name == "POSITION":
            accessor.update({"min": c.min(0).tolist(), "max": c.max(0).tolist()})
        if interleaved:
            accessor.update({"bufferView": 0, "byteOffset": at})
            at += rows.shape[1]
        else:
            accessor["bufferView"] = len(views)
            views.append({"buffer": 0, "byteOffset": at, "byteLength": rows.size, "byteStride": rows.shape[1]})
            at += rows.size
        accessors.append(accessor)
        parts.append(rows)
    buffer = np.hstack(parts).tobytes() if interleaved else b"".join(p.tobytes() for p in parts)
    if interleaved:
        views = [{"buffer": 0, "byteOffset": 0, "byteLength": len(buffer), "byteStride": stride}]
    out = {"asset": {"version": "2.0"}, "extensionsUsed": [NAME], "scene": 0, "scenes": [{"nodes": [0]}],
           "nodes": [{"children": [1], **node[0]}, {"mesh": 0, **node[1]}],
           "meshes": [{"primitives": [{"mode": 0, "attributes": {name: i for i, name in enumerate(columns)},
                                       "extensions": {NAME: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}}}]}],
           "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(buffer)}]}
    return out, buffer


def glb(out, buffer):
    text = json.dumps(out).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def main():
    folder = pathlib.Path(sys.argv[1])
    random = np.random.default_rng(47)
    put = lambda name, data: (folder / name).write_bytes(data)
    tell = lambda name, values: (folder / name).write_text(json.dumps(values) + "\n")

    columns = columns_of(random, 7, 3, "f4", "f4", "f4")
    put("plain.glb", glb(*document(columns, ({}, {}))))
    tell("plain.json", expected(columns, 3, np.eye(3), 1, np.zeros(3)))

    # Two nodes: an outer shift and turn, an inner turn and scale.
    outer, inner = [0.5, -0.5, 0.5, 0.5], [0.36, 0.48, 0.0, 0.8]
    columns = columns_of(random, 5, 3, "i2", "u2", "u1")
    nodes = ({"rotation": outer, "translation": [1, 2, 3]}, {"rotation": inner, "scale": [2, 2, 2]})
    turned, buffer = document(columns, nodes, True)
    turned["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    put("turned.gltf", json.dumps(turned).encode())
    tell("turned.json", expected(columns, 3, rotation(outer) @ rotation(inner), 2, np.array([1, 2, 3])))

    # The same transforms as a matrix, column by column, and the buffer in a file of its own.
    columns = columns_of(random, 6, 1, "i1", "f4", "u2")
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 0.5 * rotation(inner), [-1, 0, 4]
    beside, buffer = document(columns, ({}, {"matrix": matrix.T.flatten().tolist()}))
    beside["buffers"][0]["uri"] = "beside%20it.bin"
    put("beside.gltf", json.dumps(beside).encode())
    put("beside it.bin", buffer)
    tell("beside.json", expected(columns, 1, rotation(inner), 0.5, np.array([-1, 0, 4])))


main()
