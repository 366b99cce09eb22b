"""Every kind of camera that render accepts: a small red dot of a scene is drawn where its camera projects it."""
import json
import math
import os

import support

DOT = (0.21, -0.13, 0.34)
# World to camera: rotated about y, then moved; pixels that are not square, a principal point off the centre.
ANGLE, MOVE = 0.4, (0.1, -0.05, 2.2)
W, H, FX, FY, CX, CY = 90, 70, 110.0, 80.0, 31.5, 48.25


def rotation():
    c, s = math.cos(ANGLE), math.sin(ANGLE)
    return [[c, 0, s], [0, 1, 0], [-s, 0, c]]


def w2c():
    return [[*row, move] for row, move in zip(rotation(), MOVE)] + [[0, 0, 0, 1]]


def centre():
    return [-sum(rotation()[k][i] * MOVE[k] for k in range(3)) for i in range(3)]


def c2w():
    return [[rotation()[k][i] for k in range(3)] + [centre()[i]] for i in range(3)] + [[0, 0, 0, 1]]


def projected(fx=FX, fy=FY, cx=CX, cy=CY):
    x, y, z = (sum(r * d for r, d in zip(row, (*DOT, 1))) for row in w2c()[:3])
    return fx * x / z + cx, fy * y / z + cy


def quaternion():
    return math.cos(ANGLE / 2), 0, math.sin(ANGLE / 2), 0


class Cameras(support.Case):
    def setUp(self):
        super().setUp()
        support.write_scene(self.path("scene.ply"), [(DOT, (1, 0, 0), 0.004, 0.99)])

    def write(self, name, value):
        os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
        with open(self.path(name), "w") as f:
            f.write(value if isinstance(value, str) else json.dumps(value))
        return self.path(name)

    def dot(self, cameras, size=(W, H), *more):
        """Draws with the first camera. Returns the centre of what is not white, in pixels."""
        self.succeeds("render", self.path("scene.ply"), "--cameras", cameras, "--images", self.path("out"), "--overwrite", *more)
        width, height, pixels = support.read_png(self.path("out", "0000.png"))
        self.assertEqual((width, height), size)
        weight = [255 - pixels[3 * i + 1] for i in range(width * height)]     # red reduces green
        self.assertGreater(sum(weight), 0)
        return (sum((i % width + 0.5) * v for i, v in enumerate(weight)) / sum(weight),
                sum((i // width + 0.5) * v for i, v in enumerate(weight)) / sum(weight))

    def check(self, cameras, expected, *more, size=(W, H)):
        for got, wanted in zip(self.dot(cameras, size, *more), expected):
            self.assertAlmostEqual(got, wanted, delta=0.1)

    def ours(self, **changes):
        return [{"file": "a.png", "w": W, "h": H, "fx": FX, "fy": FY, "cx": CX, "cy": CY, "w2c": w2c(), **changes}]

    def test_ours(self):
        path = self.write("c/cameras.json", self.ours())
        self.check(path, projected())
        self.check(self.path("c"), projected())

    def test_size(self):
        path = self.write("cameras.json", self.ours())
        for width, height in ((45, 35), (180, 70), (33, 101), (301, 7)):
            x, y = width / W, height / H
            self.check(path, projected(FX * x, FY * y, CX * x, CY * y), "--size", f"{width}x{height}", size=(width, height))

    def test_principal_point_outside_the_picture(self):
        u, v = projected()
        path = self.write("cameras.json", self.ours(cx=CX - u - 20, cy=CY + H))
        code, _, err = support.run("render", self.path("scene.ply"), "--cameras", path, "--images", self.path("empty"))
        self.assertEqual(code, 0, err)                                          # the dot is outside the picture, which is white
        self.assertEqual(set(support.read_png(self.path("empty", "0000.png"))[2]), {255})
        path = self.write("cameras.json", self.ours(cx=-60, fx=600.0))
        self.check(path, projected(fx=600.0, cx=-60))

    def test_inria(self):
        path = self.write("cameras.json", [{"id": 0, "img_name": "a", "width": W, "height": H, "position": centre(),
                                            "rotation": [row[:3] for row in c2w()[:3]], "fx": FX, "fy": FY}])
        self.check(path, projected(cx=W / 2, cy=H / 2))

    def test_transforms(self):
        matrix = [[row[0], -row[1], -row[2], row[3]] for row in c2w()[:3]] + [[0, 0, 0, 1]]
        frame = {"file_path": "a.png", "transform_matrix": matrix}
        self.check(self.write("t/transforms.json", {"w": W, "h": H, "fl_x": FX, "fl_y": FY, "cx": CX, "cy": CY, "frames": [frame]}), projected())
        own = {**frame, "fl_x": FX, "fl_y": FY, "cx": CX, "cy": CY, "w": W, "h": H}
        self.check(self.write("t/transforms.json", {"fl_x": 1, "frames": [own]}), projected())
        angle = {"camera_angle_x": 2 * math.atan(W / (2 * FX)), "camera_angle_y": 2 * math.atan(H / (2 * FY)), "frames": [frame]}
        self.check(self.write("t/transforms.json", {"w": W, "h": H, **angle}), projected(cx=W / 2, cy=H / 2))
        # Without a size and without a picture to take it from: --size, else 512 x 512.
        self.check(self.write("t/transforms.json", angle), projected(cx=W / 2, cy=H / 2), "--size", f"{W}x{H}")
        x, y = 512 / W, 512 / H
        self.check(self.path("t"), projected(FX * x, FY * y, 256, 256), size=(512, 512))

    def test_colmap(self):
        self.write("model/sparse/0/cameras.txt", f"# cameras\n1 PINHOLE {W} {H} {FX} {FY} {CX} {CY}\n")
        pose = " ".join(map(repr, (*quaternion(), *MOVE)))
        self.write("model/sparse/0/images.txt", f"1 {pose} 1 a.png\n\n")
        self.write("model/sparse/0/points3D.txt", "")
        for path in ("model", "model/sparse/0", "model/sparse/0/cameras.txt"):
            self.check(self.path(path), projected())

    def test_path(self):
        turned = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 2], [0, 0, 0, 1]]
        keys = self.write("keys:of mine/cameras.json", self.ours() + self.ours(w2c=turned) + self.ours(w2c=turned, cx=0))
        for name in (f"path:{keys}:4", f"path:{self.path('keys:of mine')}:1"):    # N follows the last colon
            self.check(name, projected())
        out, _ = self.succeeds("render", self.path("scene.ply"), "--cameras", f"path:{keys}:7", "--images", self.path("seven"), "--json")
        self.assertEqual(len(json.loads(out)["images"]), 7)
        self.check(f"path:{keys}:3", projected(FX / 2, FY / 2, CX / 2, CY / 2), "--size", f"{W // 2}x{H // 2}", size=(W // 2, H // 2))
        self.refuses(1, ["key camera 1", "70 x 90"], "render", self.path("scene.ply"), "--cameras",
                     "path:" + self.write("other.json", self.ours() + self.ours(w=H, h=W)) + ":5", "--images", self.path("x"))
        self.refuses(1, "nowhere.json", "render", self.path("scene.ply"), "--cameras", "path:nowhere.json:5", "--images", self.path("x"))

    def test_path_while_reconstructing(self):
        out, _ = self.succeeds(*self.reconstruct("--render", f"path:{self.views}:5", "--images", self.path("frames"), "--json"))
        self.assertEqual(json.loads(out)["images"], 5)
        self.assertEqual(len(os.listdir(self.path("frames"))), 5)


if __name__ == "__main__":
    support.main()
