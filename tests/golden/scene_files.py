"""Makes the scene files in scenes/ and the values that a reader must find in them: scene_files.py [FOLDER]

The files are random bytes in the layout of their format, with the extreme ones among them. The values are computed from these bytes by the
format's description, in double, and stored beside each file as NAME.values: int32 count, degree, antialias; then float32 means [K,3], scales
[K,3] (standard deviations), rotations [K,4] (w x y z, of length 1), opacities [K], spherical harmonics [K,S,3]. All in the frame right, down,
front."""
import gzip
import pathlib
import struct
import sys

import numpy as np

C0 = 0.28209479177387814


def save(folder, name, content, values, antialias=0):
    means, scales, rotations, opacities, sh = values
    count, functions = sh.shape[:2]
    (folder / name).write_bytes(content)
    with open(folder / (name + ".values"), "wb") as file:
        file.write(struct.pack("<3i", count, int(round(functions ** 0.5)) - 1, antialias))
        for each in (means, scales, rotations / np.linalg.norm(rotations, axis=1, keepdims=True), opacities, sh):
            file.write(np.ascontiguousarray(each, dtype="<f4").tobytes())


def bytes_of(rng, *shape):
    out = rng.integers(0, 256, shape, dtype=np.uint8)
    out.flat[0], out.flat[-1] = 0, 255
    return out


def signs(flip, degree):
    """How each basis function above degree 0 changes when its argument's parts are multiplied by `flip`. The last one is even in all of them;
    its `y` is the library's of the format, and so that of the files."""
    x, y, z = flip
    bands = [[y, z, x], [x * y, y * z, 1, x * z, 1], [y, x * y * z, y, z, x, z, x], [x * y, y * z, x * y, y * z, 1, x * z, 1, x * z, y]]
    return np.array([s for band in bands[:degree] for s in band], dtype=np.float64)


def spz(rng, version, degree, bits=12, antialias=0, frame=None):
    count, rest = 7, (degree + 1) ** 2 - 1
    axes = (frame or 4) - 1  # right, up, front are the bits
    flip = np.array([1 if axes & 1 else -1, -1 if axes & 2 else 1, 1 if axes & 4 else -1], dtype=np.float64)
    turn = np.array([1, flip[1] * flip[2], flip[0] * flip[2], flip[0] * flip[1]])
    if version == 1:
        half = rng.normal(0, 3, (count, 3)).astype("<f2")
        half[0] = (0, -0.0, 6e-8)  # a zero, a negative zero, and the smallest number above it
        positions, means = half.tobytes(), half.astype(np.float64)
    else:
        fixed = rng.integers(-2 ** 23, 2 ** 23, (count, 3))
        fixed[0] = (-2 ** 23, 2 ** 23 - 1, -1)
        positions = b"".join(int(v).to_bytes(3, "little", signed=True) for v in fixed.ravel())
        means = fixed / 2.0 ** bits
    alphas, colors, scales = bytes_of(rng, count), bytes_of(rng, count, 3), bytes_of(rng, count, 3)
    sh = bytes_of(rng, count, rest, 3) if rest else np.zeros((count, 0, 3), np.uint8)
    if version < 3:
        q = rng.normal(size=(count, 4))
        q *= np.sign(q[:, :1]) / np.linalg.norm(q, axis=1, keepdims=True)
        packed = np.round(q[:, 1:] * 127.5 + 127.5).clip(0, 255).astype(np.uint8)
        xyz = packed / 127.5 - 1
        rotation = np.concatenate([np.sqrt(np.maximum(0, 1 - (xyz ** 2).sum(1, keepdims=True))), xyz], axis=1)
        rotations = packed.tobytes()
    else:
        words, rotation = [], []
        for k in range(count):
            largest = k % 4
            magnitudes, negative = rng.integers(0, 295, 3), rng.integers(0, 2, 3)  # sum of squares below 1
            word, xyzw, others = largest, [0.0] * 4, [i for i in range(4) if i != largest]
            for i, size, sign in zip(others, magnitudes, negative):
                word = word << 10 | int(sign) << 9 | int(size)
                xyzw[i] = (-1 if sign else 1) * size / 511 / 2 ** 0.5
            xyzw[largest] = (1 - sum(v * v for v in xyzw)) ** 0.5
            words.append(word)
            rotation.append([xyzw[3]] + xyzw[:3])
        rotation, rotations = np.array(rotation), struct.pack(f"<{count}I", *words)
    streams = [positions, alphas.tobytes(), colors.tobytes(), scales.tobytes(), rotations, sh.tobytes()]
    record = b"" if frame is None else struct.pack("<IIIIII", 0x12345678, 4, 9, 0xADBE0003, 4, frame)  # an unknown one comes first
    flags = antialias | (2 if record else 0)
    head = struct.pack("<IIIBBB", 0x5053474E, version, count, degree, bits, flags)
    if version < 4:
        content = gzip.compress(head + b"\0" + b"".join(streams) + record, mtime=0)
    else:
        streams = [s for s in streams if s]
        packed = [zstd(s) for s in streams]
        table = b"".join(struct.pack("<QQ", len(p), len(s)) for p, s in zip(packed, streams))
        content = head + struct.pack("<BI", len(streams), 32 + len(record)) + bytes(12) + record + table + b"".join(packed)
    harmonics = np.zeros((count, rest + 1, 3))
    harmonics[:, 0] = (colors / 255.0 - 0.5) / 0.15
    harmonics[:, 1:] = (sh.astype(np.float64) - 128) / 128 * signs(flip, degree)[None, :, None]
    values = means * flip, np.exp(scales / 16.0 - 10), rotation * turn, alphas / 255.0, harmonics
    return content, values


def zstd(data):
    """A frame of one block that is stored as it is (RFC 8878)."""
    assert len(data) < 2 ** 16
    return struct.pack("<IBIHB", 0xFD2FB528, 0xA0, len(data), (len(data) << 3 | 1) & 0xFFFF, len(data) >> 13) + data


def splat(rng):
    count = 9
    means, scales = rng.normal(0, 2, (count, 3)).astype("<f4"), np.exp(rng.normal(-4, 1, (count, 3))).astype("<f4")
    scales[0, 0] = 0
    colors, q = bytes_of(rng, count, 4), rng.normal(size=(count, 4))
    rotations = (q / np.linalg.norm(q, axis=1, keepdims=True) * 128 + 128).round().clip(0, 255).astype(np.uint8)
    content = b"".join(means[k].tobytes() + scales[k].tobytes() + colors[k].tobytes() + rotations[k].tobytes() for k in range(count))
    sh = ((colors[:, :3] / 255.0 - 0.5) / C0)[:, None]
    return content, (means, scales, (rotations - 128.0) / 128, colors[:, 3] / 255.0, sh)


def compressed_ply(rng, degree, count=300, bounded_colours=True):
    blocks, rest = -(-count // 256), (degree + 1) ** 2 - 1
    names = [f"{end}_{axis}" for group in ("", "scale_") for end in (f"min_{group}"[:-1], f"max_{group}"[:-1]) for axis in "xyz"]
    low = np.concatenate([rng.normal(0, 2, (blocks, 3)), rng.uniform(-9, -5, (blocks, 3)), rng.uniform(-1, 0.4, (blocks, 3))], axis=1)
    high = low + rng.uniform(0.1, 3, low.shape)
    low, high = low.astype("<f4"), high.astype("<f4")
    chunk = np.concatenate([low[:, :3], high[:, :3], low[:, 3:6], high[:, 3:6]], axis=1)
    if bounded_colours:
        names += [f"{end}_{c}" for end in ("min", "max") for c in "rgb"]
        chunk = np.concatenate([chunk, low[:, 6:], high[:, 6:]], axis=1)
    else:
        low[:, 6:], high[:, 6:] = 0, 1
    position, scale = [[rng.integers(0, 2 ** b, count) for b in (11, 10, 11)] for _ in range(2)]
    colour = bytes_of(rng, count, 4).astype(np.int64)
    largest, parts = np.arange(count) % 4, rng.integers(330, 694, (count, 3))  # of at most 0.25 in the square each
    pack = lambda v: v[0] << 21 | v[1] << 11 | v[2]
    words = np.stack([pack(position), largest << 30 | parts[:, 0] << 20 | parts[:, 1] << 10 | parts[:, 2], pack(scale),
                      colour[:, 0] << 24 | colour[:, 1] << 16 | colour[:, 2] << 8 | colour[:, 3]], axis=1).astype("<u4")
    sh = bytes_of(rng, count, 3 * rest) if rest else np.zeros((count, 0), np.uint8)
    head = ["ply", "format binary_little_endian 1.0", "comment SplatRenderMode: mip", f"element chunk {blocks}"]
    head += [f"property float {name}" for name in names] + [f"element vertex {count}"]
    head += [f"property uint packed_{name}" for name in ("position", "rotation", "scale", "color")]
    if rest:
        head += [f"element sh {count}"] + [f"property uchar f_rest_{i}" for i in range(3 * rest)]
    content = ("\n".join(head + ["end_header"]) + "\n").encode() + chunk.astype("<f4").tobytes() + words.tobytes() + sh.tobytes()
    block = np.arange(count) // 256
    lo, hi = low.astype(np.float64)[block], high.astype(np.float64)[block]
    between = lambda first, share: lo[:, first:first + 3] * (1 - share) + hi[:, first:first + 3] * share
    share = lambda v: np.stack([v[0] / 2047, v[1] / 1023, v[2] / 2047], axis=1)
    rotation = np.zeros((count, 4))
    for k in range(count):
        others = [i for i in range(4) if i != largest[k]]
        rotation[k, others] = (parts[k] / 1023 - 0.5) * 2 ** 0.5
        rotation[k, largest[k]] = (1 - (rotation[k] ** 2).sum()) ** 0.5
    harmonics = np.zeros((count, rest + 1, 3))
    harmonics[:, 0] = (between(6, colour[:, :3] / 255.0) - 0.5) / C0
    coefficient = np.where(sh == 0, 0, np.where(sh == 255, 1, (sh + 0.5) / 256)) * 8 - 4
    harmonics[:, 1:] = coefficient.reshape(count, 3, rest).transpose(0, 2, 1)
    return content, (between(0, share(position)), np.exp(between(3, share(scale))), rotation, colour[:, 3] / 255.0, harmonics)


def ply(rng, degree):
    count, rest = 5, (degree + 1) ** 2 - 1
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"] + [f"f_rest_{i}" for i in range(3 * rest)]
    names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    rows = rng.normal(size=(count, len(names))).astype("<f4")
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"] + [f"property float {name}" for name in names] + ["end_header"]
    wide, last = rows.astype(np.float64), 9 + 3 * rest
    sh = np.concatenate([wide[:, None, 6:9], wide[:, 9:last].reshape(count, 3, rest).transpose(0, 2, 1)], axis=1)
    values = wide[:, :3], np.exp(wide[:, last + 1:last + 4]), wide[:, last + 4:], 1 / (1 + np.exp(-wide[:, last])), sh
    return ("\n".join(head) + "\n").encode() + rows.tobytes(), values


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).parent / "scenes"
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(47)
    for version in (1, 2, 3, 4):
        for degree in range(5):
            save(folder, f"version{version}_degree{degree}.spz", *spz(rng, version, degree))
    save(folder, "bits22_antialias.spz", *spz(rng, 4, 1, bits=22, antialias=1), antialias=1)
    save(folder, "antialias_old.spz", *spz(rng, 2, 0, antialias=1), antialias=1)
    for frame in range(1, 9):
        save(folder, f"frame{frame}.spz", *spz(rng, 4, 4, frame=frame))
    save(folder, "frame6_old.spz", *spz(rng, 3, 3, frame=6))
    save(folder, "plain.splat", *splat(rng))
    for degree in range(4):
        save(folder, f"degree{degree}.compressed.ply", *compressed_ply(rng, degree, count=300 if degree == 1 else 5), antialias=1)
    save(folder, "plain_colours.compressed.ply", *compressed_ply(rng, 0, count=6, bounded_colours=False), antialias=1)
    for degree in range(5):
        save(folder, f"degree{degree}.ply", *ply(rng, degree))


if __name__ == "__main__":
    main()
