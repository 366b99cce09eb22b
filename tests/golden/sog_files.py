#!/usr/bin/env python3
"""SOG files of random bytes, and what they mean, from the format's description alone.

  tests/golden/sog_files.py DIR      writes NAME.sog, NAME.json with the values of each Gaussian, and the folder `folder`

The expected values are computed here from the same bytes, in double: positions, logarithms of scales, quaternions w x y z, opacities and
spherical harmonics [K][S][3]. Needs numpy and Pillow."""
import io
import json
import math
import pathlib
import sys
import zipfile

import numpy as np
from PIL import Image

WIDTHS = {1: 3, 2: 8, 3: 15}


def webp(plane):
    out = io.BytesIO()
    Image.fromarray(plane, "RGBA").save(out, "WEBP", lossless=True, exact=True, quality=50)
    return out.getvalue()


def plane_of(rows, width, height):
    """[K][4] bytes as a picture; the texels beyond them hold what no reader may use."""
    plane = np.full((height * width, 4), 77, np.uint8)
    plane[: len(rows)] = rows
    return plane.reshape(height, width, 4)


def positions(mins, maxs, steps):
    log = mins + (maxs - mins) * steps / 65535
    return np.sign(log) * np.expm1(np.abs(log))


def quaternions(texels):
    out = []
    for r, g, b, a in texels.astype(int):
        if a < 252:
            out.append([1, 0, 0, 0])
            continue
        small = [(v / 255 * 2 - 1) / math.sqrt(2) for v in (r, g, b)]
        q = small[: a - 252] + [math.sqrt(max(0, 1 - sum(v * v for v in small)))] + small[a - 252:]
        out.append((np.array(q) / np.linalg.norm(q)).tolist())
    return out


def make(random, version, count, degree, palette, model=None):
    """Returns the files of a scene by name, and its values."""
    width = 4 * math.ceil(math.sqrt(count) / 4)
    height = math.ceil(count / width)
    picture = lambda rows: webp(plane_of(rows, width, height))
    opaque = np.full((count, 1), 255, np.uint8)
    mins, maxs = np.array([-1.5, -0.25, 0.5]), np.array([2.0, 3.0, 0.5])
    steps = random.integers(0, 65536, (count, 3))
    steps[0], steps[1] = 0, 65535
    low, high = (steps & 255).astype(np.uint8), (steps >> 8).astype(np.uint8)
    quats = random.integers(0, 256, (count, 4)).astype(np.uint8)
    quats[:, 3] = 252 + np.arange(count) % 4
    quats[-1, 3] = 17
    # Components above sqrt(1/2) are none of the three smaller ones.
    quats[:-1, :3] = 80 + quats[:-1, :3] % 96
    scales, sh0 = random.integers(0, 256, (2, count, 4)).astype(np.uint8)
    scales[:, 3] = 255
    sh0[0, 3], sh0[1, 3] = 0, 255
    meta = {"count": count, "means": {"mins": mins.tolist(), "maxs": maxs.tolist(), "files": ["means_l.webp", "means_u.webp"]},
            "scales": {"files": ["scales.webp"]}, "quats": {"files": ["quats.webp"]}, "sh0": {"files": ["sh0.webp"]}}
    files = {"means_l.webp": picture(np.hstack([low, opaque])), "means_u.webp": picture(np.hstack([high, opaque])),
             "scales.webp": picture(scales), "quats.webp": picture(quats), "sh0.webp": picture(sh0)}
    values = {"degree": degree, "mean": positions(mins, maxs, steps).tolist(), "quat": quaternions(quats)}
    if version == 2:
        meta["version"] = 2
        scale_book = np.sort(random.normal(-4, 2, 256)).astype(np.float32)
        colour_book = np.sort(random.normal(0, 1, 256)).astype(np.float32)
        meta["scales"]["codebook"], meta["sh0"]["codebook"] = scale_book.tolist(), colour_book.tolist()
        values["log_scale"] = scale_book[scales[:, :3]].tolist()
        colours = colour_book[sh0[:, :3]]
        values["opacity"] = (sh0[:, 3] / 255).tolist()
    else:
        del meta["count"]
        for name, shape in (("means", [count, 3]), ("scales", [count, 3]), ("quats", [count, 4]), ("sh0", [count, 1, 4])):
            meta[name].update({"shape": shape, "dtype": "float32"})
        ends = np.array([[-9.0, -8.0, -7.0], [-1.0, 0.0, 1.0]])
        meta["scales"].update({"mins": ends[0].tolist(), "maxs": ends[1].tolist()})
        values["log_scale"] = (ends[0] + (ends[1] - ends[0]) * scales[:, :3] / 255).tolist()
        ends = np.array([[-2.0, -1.0, -3.0, -6.0], [2.0, 3.0, 1.0, 5.0]])
        meta["sh0"].update({"mins": ends[0].tolist(), "maxs": ends[1].tolist()})
        both = ends[0] + (ends[1] - ends[0]) * sh0 / 255
        colours = both[:, :3]
        values["opacity"] = (1 / (1 + np.exp(-both[:, 3]))).tolist()
    sh = np.zeros((count, (degree + 1) ** 2, 3))
    sh[:, 0] = colours
    if degree:
        each = WIDTHS[degree]
        centroids = random.integers(0, 256, (palette, each, 4)).astype(np.uint8)
        labels = random.integers(0, palette, count)
        labels[:2] = 0, palette - 1
        if version == 2:
            labels[2] = palette  # beyond the palette: no view-dependent colour
        rows = math.ceil(palette / 64)
        plane = np.full((rows * 64, each, 4), 99, np.uint8)
        plane[:palette] = centroids
        files["shN_centroids.webp"] = webp(plane.reshape(rows, 64 * each, 4))
        both = np.stack([labels & 255, labels >> 8, labels * 0, labels * 0 + 255], 1).astype(np.uint8)
        files["shN_labels.webp"] = picture(both)
        meta["shN"] = {"files": ["shN_centroids.webp", "shN_labels.webp"]}
        if version == 2:
            book = np.sort(random.normal(0, 0.2, 256)).astype(np.float32)
            meta["shN"].update({"count": palette, "bands": degree, "codebook": book.tolist()})
            meaning = book[centroids[..., :3]].astype(float)
        else:
            meta["shN"].update({"shape": [count, 3 * each], "mins": -0.75, "maxs": 0.5})
            meaning = -0.75 + 1.25 * centroids[..., :3] / 255
        inside = labels < palette
        sh[inside, 1:] = meaning[labels[inside]]
    values["sh"] = sh.tolist()
    if model:
        meta["model"] = model
    files["meta.json"] = json.dumps(meta).encode()
    return files, values


def main():
    folder = pathlib.Path(sys.argv[1])
    random = np.random.default_rng(20261127)
    for name, arguments, how in (("version2_degree3", (2, 70, 3, 65), zipfile.ZIP_STORED), ("version2_degree0", (2, 9, 0, 0), zipfile.ZIP_DEFLATED),
                                 ("version2_degree1", (2, 20, 1, 300, "antialiased"), zipfile.ZIP_STORED),
                                 ("version1_degree2", (1, 30, 2, 64), zipfile.ZIP_STORED), ("folder", (2, 5, 1, 3), None)):
        files, values = make(random, *arguments)
        if how is None:
            (folder / name).mkdir(exist_ok=True)
            for file, data in files.items():
                (folder / name / file).write_bytes(data)
        else:
            with zipfile.ZipFile(folder / f"{name}.sog", "w", how) as archive:
                for file, data in files.items():
                    archive.writestr(zipfile.ZipInfo(file), data, how)
        (folder / f"{name}.json").write_text(json.dumps(values) + "\n")


main()
