"""vsplat mesh: a torus of flat Gaussians or surfels, drawn and fused, beside the true surface; the files in other readers; wrong requests."""
import collections
import json
import math
import pathlib
import random
import signal
import struct
import subprocess
import time

import support

RING, TUBE = 0.35, 0.13  # radii: the torus is 0.96 wide
DEVIATION = 0.013  # of a Gaussian along the surface


def torus(a, b):
    """The point and the normal at two angles."""
    normal = (math.cos(a) * math.cos(b), math.sin(a) * math.cos(b), math.sin(b))
    return tuple(c * RING + TUBE * n for c, n in zip((math.cos(a), math.sin(a), 0), normal)), normal


def off(p):
    """The distance of a point from the torus."""
    return abs(math.hypot(math.hypot(p[0], p[1]) - RING, p[2]) - TUBE)


def write_torus(path, surfels=False, count=5000, opacity=0.95, comment=""):
    """Flat Gaussians evenly on the torus, coloured by their place."""
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", *([] if surfels else ["scale_2"]), "rot_0", "rot_1", "rot_2", "rot_3"]
    draw, rows = random.Random(1), []
    while len(rows) < count:
        a, b = draw.uniform(0, 2 * math.pi), draw.uniform(0, 2 * math.pi)
        if draw.uniform(0, RING + TUBE) > RING + TUBE * math.cos(b):
            continue
        point, n = torus(a, b)
        w, x, y = 1 + n[2], -n[1], n[0]  # turns z to the normal
        length = math.sqrt(w * w + x * x + y * y) or 1
        turn = (w / length, x / length, y / length, 0) if w > 1e-6 else (0, 1, 0, 0)
        scales = [math.log(DEVIATION)] * 2 + ([] if surfels else [math.log(0.0013)])
        rows.append((*point, *(p / 0.28209479177387814 for p in point), math.log(opacity / (1 - opacity)), *scales, *turn))
    head = f"ply\nformat binary_little_endian 1.0\n{comment}element vertex {count}\n" + "".join(f"property float {n}\n" for n in names) + "end_header\n"
    pathlib.Path(path).write_bytes(head.encode() + b"".join(struct.pack(f"<{len(names)}f", *row) for row in rows))


def read_ply(path):
    """Positions, normals, colours in 0 to 255, and triangles."""
    head, rest = pathlib.Path(path).read_bytes().split(b"end_header\n", 1)
    words = [line.split() for line in head.decode().splitlines()]
    counts = {line[1]: int(line[2]) for line in words if line[0] == "element"}
    row = "<3d3f3B" if ["property", "double", "x"] in words else "<6f3B"
    size, n = struct.calcsize(row), counts["vertex"]
    vertices = list(struct.iter_unpack(row, rest[:size * n]))
    faces = list(struct.iter_unpack("<B3i", rest[size * n:]))
    assert len(faces) == counts["face"] and {f[0] for f in faces} <= {3}
    return [v[:3] for v in vertices], [v[3:6] for v in vertices], [v[6:] for v in vertices], [f[1:] for f in faces]


def read_glb(path):
    """The document and its accessors' values."""
    data = pathlib.Path(path).read_bytes()
    magic, version, length, text_bytes, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    document, at = json.loads(data[20:20 + text_bytes]), 20 + text_bytes
    assert struct.unpack("<I4s", data[at:at + 8]) == (len(data) - at - 8, b"BIN\0")
    values = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        row = {"VEC3": 3, "VEC4": 4, "SCALAR": 1}[accessor["type"]], {5126: "f", 5123: "H", 5125: "I"}[accessor["componentType"]]
        begin = at + 8 + view["byteOffset"]
        values.append(list(struct.iter_unpack("<{}{}".format(*row), data[begin:begin + view["byteLength"]])))
        assert len(values[-1]) == accessor["count"]
    return document, values


def open_edges(triangles):
    edges = collections.Counter((t[i], t[(i + 1) % 3]) for t in triangles for i in range(3))
    return sum(edges[edge] != edges[edge[::-1]] for edge in edges)


class Mesh(support.Case):
    def setUp(self):
        super().setUp()
        self.scene = self.path("torus.ply")
        write_torus(self.scene)

    def mesh(self, *more, scene=None, output="m.ply", voxels=64):
        return ("mesh", scene or self.scene, "--output", self.path(output), "--voxels", voxels, *more)

    def check_torus(self, path, width=0.96, wrong_colour=0.06):
        """Both ways less than 1 % of its width apart on average, closed, coloured; normals point outwards."""
        points, normals, colours, triangles = read_ply(path)
        self.assertLess(sum(map(off, points)) / len(points), 0.01 * width)
        cells = collections.defaultdict(list)
        for p in points:
            cells[tuple(int(v // 0.05) for v in p)].append(p)
        draw, distances = random.Random(2), []
        for _ in range(300):
            at, _ = torus(draw.uniform(0, 2 * math.pi), draw.uniform(0, 2 * math.pi))
            cell = [int(v // 0.05) for v in at]
            near = [p for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) for p in cells[cell[0] + i, cell[1] + j, cell[2] + k]]
            distances.append(min(math.dist(at, p) for p in near) if near else 1)
        self.assertLess(sum(distances) / len(distances), 0.015 * width)  # to a vertex, not to a triangle
        self.assertEqual(open_edges(triangles), 0)
        wrong = []
        for p, n, colour in zip(points[::7], normals[::7], colours[::7]):
            ring = math.hypot(p[0], p[1])
            out = [p[0] * (1 - RING / ring), p[1] * (1 - RING / ring), p[2]]
            self.assertGreater(sum(a * b for a, b in zip(n, out)), 0)
            wrong += [abs(value / 255 - 0.5 - place) for value, place in zip(colour, p)]
        self.assertLess(sum(wrong) / len(wrong), DEVIATION)
        self.assertLess(max(wrong), wrong_colour)
        return points, triangles

    def test_gaussians_and_surfels(self):
        out, _ = self.succeeds(*self.mesh("--json"))
        points, triangles = self.check_torus(self.path("m.ply"))
        result = json.loads(out)
        self.assertEqual((result["vertices"], result["triangles"], result["output"]), (len(points), len(triangles), self.path("m.ply")))
        self.assertGreater(len(triangles), 8000)
        self.succeeds(*self.mesh("--depth", "expected", output="expected.ply"))
        self.check_torus(self.path("expected.ply"))
        write_torus(self.path("surfels.ply"), surfels=True)
        self.succeeds(*self.mesh("--max-triangles", 5000, scene=self.path("surfels.ply"), output="surfels_mesh.ply"))
        # A vertex has the colour of Gaussians around it, which end at 3.3 standard deviations; simplifying moves it.
        _, triangles = self.check_torus(self.path("surfels_mesh.ply"), wrong_colour=6 * DEVIATION)
        self.assertTrue(4500 < len(triangles) <= 5000)

    def test_files_are_read_by_others_and_the_same_every_time(self):
        self.succeeds(*self.mesh("--max-triangles", 3000))
        self.succeeds(*self.mesh("--max-triangles", 3000, output="m.GLB"))
        self.succeeds(*self.mesh("--max-triangles", 3000, output="again.ply"))
        self.assertEqual(pathlib.Path(self.path("m.ply")).read_bytes(), pathlib.Path(self.path("again.ply")).read_bytes())
        points, normals, colours, triangles = read_ply(self.path("m.ply"))
        document, (at, turned, linear, indices) = read_glb(self.path("m.GLB"))
        self.assertEqual(at, [(-x, -y, z) for x, y, z in points])  # as scenes in .glb
        self.assertEqual(turned, [(-x, -y, z) for x, y, z in normals])
        self.assertEqual([i for i, in indices], [i for t in triangles for i in t])
        self.assertEqual(document["accessors"][0]["max"], [max(p[c] for p in at) for c in range(3)])
        for bytes_, shorts in list(zip(colours, linear))[::50]:
            for byte, short in zip(bytes_, shorts):
                decoded = ((byte / 255 + 0.055) / 1.055) ** 2.4 if byte > 10 else byte / 255 / 12.92
                self.assertAlmostEqual(short / 65535, decoded, delta=0.008)
        # assimp reads the PLY, and the reader of glTF the GLB.
        out, _ = self.succeeds("dataset", "render", self.path("m.ply"), self.path("m.GLB"), "--views", 1, "--size", 32, "--output", self.path("set"), "--json")
        self.assertEqual([o["triangles"] for o in json.loads(out)["objects"]], [len(triangles)] * 2)

    def test_cameras_and_a_cube(self):
        self.succeeds("render", self.scene, "--cameras", "orbit:8", "--size", "96x96", "--orbit-elevation", 40, "--up", "0,0,1", "--write-cameras", self.path("c.json"))
        self.succeeds(*self.mesh("--cameras", self.path("c.json"), voxels=48))
        points, _, _, triangles = read_ply(self.path("m.ply"))
        self.assertLess(sum(map(off, points)) / len(points), 0.0096)
        self.assertGreater(open_edges(triangles), 20)  # no camera has seen it from below
        self.assertGreater(min(p[2] for p in points), -TUBE)
        self.succeeds(*self.mesh("--center", "0.35,0,0", "--scale", 0.3, output="part.ply"))
        points = read_ply(self.path("part.ply"))[0]
        self.assertTrue(all(abs(p[0] - 0.35) < 0.155 and abs(p[1]) < 0.155 for p in points))
        self.refuses(1, ["no surface", "cube"], *self.mesh("--center", "5,0,0", "--scale", 1, output="none.ply"))

    def test_far_from_the_origin(self):
        write_torus(self.scene, count=2000, comment="comment vsplat offset 4000000 0 -70000\n")
        self.succeeds(*self.mesh(voxels=32))
        self.succeeds(*self.mesh(voxels=32, output="m.glb"))
        document, (at, *_) = read_glb(self.path("m.glb"))
        self.assertEqual(document["nodes"][0]["translation"], [-4000000, 0, -70000])
        for (x, y, z), p in zip(read_ply(self.path("m.ply"))[0], at):
            for a, b in zip((x - 4000000, y, z + 70000), (-p[0], -p[1], p[2])):
                self.assertAlmostEqual(a, b, places=8)
        self.succeeds(*self.mesh("--center", "4000000.35,0,-70000", "--scale", 0.3, voxels=32, output="part.ply"))
        self.assertTrue(all(abs(p[0] - 4000000.35) < 0.17 for p in read_ply(self.path("part.ply"))[0]))

    def test_wrong_requests(self):
        self.refuses(2, ["--output", "m.obj", ".glb or .ply"], *self.mesh(output="m.obj"))
        for wrong in (15, 2049, 0, -1, 1.5, "many"):
            self.refuses(2, "--voxels", *self.mesh(voxels=wrong))
        for option, wrong in (("--max-triangles", -1), ("--max-triangles", 0.5), ("--min-part", "200%"), ("--min-part", "x"), ("--depth", "first")):
            self.refuses(2, option, *self.mesh(option, wrong))
        self.refuses(2, ["--center", "--scale"], *self.mesh("--center", "0,0,0"))
        self.refuses(2, ["--center", "--scale"], *self.mesh("--scale", 1))
        self.refuses(2, "--scale", *self.mesh("--center", "0,0,0", "--scale", 0))
        self.refuses(1, "nothing.ply", *self.mesh(scene=self.path("nothing.ply")))
        self.refuses(1, "torus.ply", *self.mesh(output="torus.ply/m.ply"))
        self.refuses(2, "torus.ply", *self.mesh("--overwrite", output="torus.ply"))
        write_torus(self.path("clear.ply"), count=200, opacity=0.01)
        self.refuses(1, ["clear.ply", "no surface"], *self.mesh(scene=self.path("clear.ply")))
        write_torus(self.path("empty.ply"), count=0)
        self.refuses(1, "empty.ply", *self.mesh(scene=self.path("empty.ply")))
        self.succeeds("render", self.scene, "--cameras", "orbit:2", "--size", "64x64", "--write-cameras", self.path("c.json"))
        self.refuses(1, ["blocks", "--max-host-memory"], *self.mesh("--cameras", self.path("c.json"), "--max-host-memory", 0.02, voxels=1024))

    def test_an_interrupt_leaves_nothing(self):
        before = self.snapshot()
        process = subprocess.Popen([support.VSPLAT, *map(str, self.mesh(voxels=1024))], stderr=subprocess.PIPE, text=True)
        time.sleep(3)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, err)
        self.assertEqual(self.snapshot(), before)


if __name__ == "__main__":
    support.main()
