"""examples/python: the module compared with the C library in $VSPLAT_LIBRARY and, if PyTorch is installed, with the specification."""
import copy
import ctypes as c
import gc
import pathlib
import pickle
import subprocess
import sys
import tempfile
import threading
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "examples" / "python"), str(ROOT / "tests" / "reference" / "pytorch")]

import numpy as np  # noqa: E402
import vsplat  # noqa: E402

try:
    import torch
except ImportError:
    torch = None


def camera(width=40, height=33, turn=0.0):
    w2c = np.eye(4)
    w2c[0, 0], w2c[0, 2], w2c[2, 0], w2c[2, 2] = np.cos(turn), np.sin(turn), -np.sin(turn), np.cos(turn)
    w2c[2, 3] = 2
    return vsplat.Camera(width, height, 45, 44, 19.5, 17, w2c)


def gaussians(count=50, functions=4, seed=1):
    r = np.random.default_rng(seed)
    return (r.uniform(-0.5, 0.5, (count, 3)), r.uniform(0.03, 0.12, (count, 3)), r.normal(size=(count, 4)), r.uniform(0.2, 0.9, count),
            r.normal(size=(count, functions, 3)) * 0.5)


def surfaces(values, at):
    """Median depths, normals and ids; and the pixels so near a threshold that rounding decides."""
    means, scales, quats, opacities, _ = (np.asarray(a, np.float32).astype(float) for a in values)
    median, normal = np.zeros((at.height, at.width)), np.zeros((at.height, at.width, 3))
    ids, unsure = np.full((at.height, at.width), -1), np.zeros((at.height, at.width), bool)
    seen = means @ at.w2c[:3, :3].T + at.w2c[:3, 3]
    limit = 1.3 * np.array([at.width / (2 * at.fx), at.height / (2 * at.fy)])
    light = np.ones((at.height, at.width))
    y, x = np.mgrid[0:at.height, 0:at.width] + 0.5
    for k in np.argsort(seen[:, 2], kind="stable"):
        w, i, j, l = quats[k] / np.linalg.norm(quats[k])
        turn = np.array([[1 - 2 * (j * j + l * l), 2 * (i * j - w * l), 2 * (i * l + w * j)],
                         [2 * (i * j + w * l), 1 - 2 * (i * i + l * l), 2 * (j * l - w * i)],
                         [2 * (i * l - w * j), 2 * (j * l + w * i), 1 - 2 * (i * i + j * j)]])
        axes = at.w2c[:3, :3] @ turn
        z = seen[k, 2]
        slope = np.clip(seen[k, :2] / z, -limit, limit)
        jacobian = np.array([[at.fx / z, 0, -at.fx * slope[0] / z], [0, at.fy / z, -at.fy * slope[1] / z]])
        root = jacobian @ axes @ np.diag(scales[k])
        covariance = root @ root.T + 0.3 * np.eye(2)
        inverse = np.linalg.inv(covariance)
        place = at.fx * seen[k, 0] / z + at.cx, at.fy * seen[k, 1] / z + at.cy
        d = np.stack([x - place[0], y - place[1]], -1)
        # Nothing is drawn beyond the tiles that a square of three deviations touches.
        (a, b), (_, e) = covariance
        radius = np.ceil(3 * np.sqrt((a + e) / 2 + np.sqrt(max(0.1, ((a - e) / 2) ** 2 + b * b))))
        reached = np.ones(ids.shape, bool)
        for middle, pixel in zip(place, (x, y)):
            tile = (pixel // 16).astype(int)
            reached &= (tile >= (middle - 0.5 - radius) // 16) & (tile < (middle - 0.5 + radius + 15) // 16)
        alpha = np.minimum(opacities[k] * np.exp(-0.5 * np.einsum("yxi,ij,yxj->yx", d, inverse, d)), 0.99)
        shows = reached & (alpha >= 1 / 255) & (light > 0)
        after = light * (1 - alpha)
        unsure |= (light > 0) & (np.abs(alpha * 255 - 1) < 1e-3) | shows & (np.abs(light - 0.5) < 1e-4) | shows & (np.abs(after - 1e-4) < 1e-6)
        ended = shows & (after < 1e-4)
        light[ended] = 0
        shows &= ~ended
        ids[shows & (ids < 0)] = k
        median[shows & (light > 0.5)] = z
        n = axes[:, np.argmin(scales[k])]
        normal += np.where(shows, alpha * light, 0)[..., None] * (-n if n @ seen[k] > 0 else n)
        light = np.where(shows, after, light)
    return median, normal, ids, unsure


class Module(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = vsplat.Device()

    def test_tells_of_devices(self):
        self.assertTrue(vsplat.devices())
        self.assertEqual(self.device.info["name"], vsplat.devices()[self.device.info["index"]]["name"])
        self.assertRegex(vsplat.version(), r"^\d+\.\d+\.\d+$")

    def test_draws_what_went_in(self):
        values = gaussians()
        scene = vsplat.Scene.from_arrays(*values)
        self.assertEqual((len(scene), scene.sh_degree), (50, 1))
        for given, got in zip(values, vars(scene.arrays()).values()):
            np.testing.assert_array_equal(np.asarray(given, np.float32), got)
        picture = self.device.render(scene, camera())
        self.assertEqual((picture.colour.shape, picture.alpha.shape, picture.depth.shape), ((33, 40, 3), (33, 40), (33, 40)))
        self.assertGreater(picture.alpha.max(), 0.5)
        alone = self.device.render(scene, camera(), alpha=False, depth=False)
        self.assertIsNone(alone.alpha)
        np.testing.assert_array_equal(alone.colour, picture.colour)
        np.testing.assert_array_equal(self.device.stream().render(scene, camera()).colour, picture.colour)
        with tempfile.TemporaryDirectory() as folder:
            scene.save(f"{folder}/a.ply")
            again = self.device.render(vsplat.Scene.load(f"{folder}/a.ply"), camera())
            np.testing.assert_allclose(again.colour, picture.colour, atol=1e-5)
        scene.update(opacities=np.zeros(50))
        self.assertEqual(self.device.render(scene, camera()).alpha.max(), 0)
        np.testing.assert_array_equal(scene.arrays().means, np.asarray(values[0], np.float32))
        with self.assertRaisesRegex(vsplat.Error, r"sh has the shape \[50, 9, 3\]: \[50, 4, 3\] expected"):
            scene.update(sh=gaussians(functions=9)[4])
        scene.update(*gaussians(seed=2))
        self.assertGreater(np.abs(self.device.render(scene, camera()).colour - picture.colour).max(), 0.05)

    def test_a_changed_scene_stays_where_it_was(self):
        scene = vsplat.Scene.from_arrays(*gaussians(), near=0.25, up=(0, 1, 0), offset=(5000, 0, 0))
        self.assertEqual((scene.near, scene.up.tolist(), scene.offset.tolist(), scene.surfels), (0.25, [0, 1, 0], [5000, 0, 0], False))
        self.assertIsNone(vsplat.Scene.from_arrays(*gaussians()).up)
        values = vars(scene.arrays())
        again = vsplat.Scene.from_arrays(**{**values, "sh": -values["sh"]}, like=scene)
        self.assertEqual((again.near, again.up.tolist(), again.offset.tolist()), (0.25, [0, 1, 0], [5000, 0, 0]))
        seen, other = (self.device.render(s, s.orbit(1, 40, 33)[0]) for s in (scene, again))
        self.assertGreater(seen.alpha.max(), 0.5)
        np.testing.assert_array_equal(seen.alpha, other.alpha)
        self.assertEqual(vsplat.Scene.from_arrays(**values, near=0.5, like=scene).near, 0.5)

    def test_cameras_look(self):
        looking = vsplat.Camera.looking_at((1, 2, 3), (1, 2, -4), up=(0, 1, 0))
        np.testing.assert_allclose(looking.w2c @ [1, 2, 3, 1], [0, 0, 7, 1], atol=1e-12)
        self.assertLess((looking.w2c @ [1, 3, 3, 1])[1], 0)  # up is up
        for target, up in (((1, 2, -4), (0, 1, 0)), ((1, 5, -4), (0, 1, 0)), ((1, 2, 3), (0, 0, 0))):
            with self.assertRaisesRegex(vsplat.Error, "is not along the view"):
                vsplat.Camera.looking_at(target, (1, 2, -4), up=up)

    def test_fits(self):
        truth = vsplat.Scene.from_arrays(*gaussians(20))
        cameras = [camera(turn=0.05 * i) for i in range(5)]
        views = vsplat.Views.from_arrays([self.device.render(truth, at, background=(0, 0, 0)).colour.clip(0, 1) for at in cameras], cameras)
        start = vsplat.Scene.from_arrays(*gaussians(20)[:4], np.zeros((20, 4, 3)))
        report = []
        out = self.device.fit(views, start, steps=6, progress=lambda phase, share: report.append((phase, share)))
        self.assertEqual((report[-1], len(out)), (("fitting", 1), 20))
        self.assertGreater(len(self.device.fit(views, extent="scene", steps=2)), 20)  # an object would need masks or a cube
        self.assertFalse(np.array_equal(self.device.fit(views, start, steps=6, background=(0, 0, 0)).arrays().opacities, out.arrays().opacities))
        with self.assertRaises(ZeroDivisionError):
            self.device.fit(views, start, steps=6, progress=lambda *_: 1 / 0)
        del report[:]
        self.device.fit(views, start, steps=6, progress=lambda phase, share: report.append(phase) or False)
        self.assertEqual(len(report), 1)

    def test_reconstructs(self):
        model = vsplat.Model.random("micro", seed=5)
        edge = model.info["image"]
        cameras = [vsplat.Camera(edge, edge, 20, 20, edge / 2, edge / 2, camera(turn=t).w2c) for t in (0, np.pi)]
        pictures = [np.random.default_rng(i).integers(0, 256, (edge, edge, 3), np.uint8) for i in (0, 1)]
        views = vsplat.Views.from_arrays(pictures, cameras)
        self.assertEqual(len(views), 2)
        given = views.prepare(model)
        self.assertEqual((len(given), given.scale), (2, 1.0))
        np.testing.assert_array_equal(given.picture(0), pictures[0].astype(np.float32) / 255)
        np.testing.assert_allclose(given.camera(1).w2c, cameras[1].w2c, atol=1e-12)
        self.assertEqual(len(given.orbit(3, 8, 8)), 3)
        report = []
        self.device.prepare(model, views=2)
        scene = self.device.reconstruct(model, given, voxels=[3, 21], progress=lambda *a: report.append(a))
        self.assertEqual((len(scene), report[0][0]), (6, "encoder"))
        self.assertEqual(len(scene.orbit(5)), 5)
        with self.assertRaises(vsplat.Error) as caught:
            self.device.reconstruct(model, given, progress=lambda stage, done: False)
        self.assertEqual(caught.exception.status, "cancelled")
        with self.assertRaisesRegex(ZeroDivisionError, "division"):  # an exception in a callback is raised again
            self.device.reconstruct(model, given, progress=lambda stage, done: 1 / 0)

    def test_says_what_is_wrong(self):
        with self.assertRaises(vsplat.Error) as caught:
            vsplat.Device("no such device")
        self.assertEqual(caught.exception.status, "device")
        self.assertIn("no such device", str(caught.exception))
        with self.assertRaisesRegex(vsplat.Error, r"rotations has the shape \[50, 3\]: \[50, 4\] expected"):
            vsplat.Scene.from_arrays(*(a[:, :3] if a.shape == (50, 4) else a for a in gaussians()))
        with self.assertRaisesRegex(vsplat.Error, "a.ply"):
            vsplat.Scene.load("/nonexistent/a.ply")
        with self.assertRaisesRegex(vsplat.Error, r"pictures\[0\].*\[33, 40, any\] expected"):
            vsplat.Views.from_arrays([np.zeros((40, 33, 3))], [camera()])
        with self.assertRaisesRegex(vsplat.Error, r"pixel 0, 0 of channel 0 is 255"):
            vsplat.Views.from_arrays([np.full((33, 40, 3), 255.0)], [camera()])

    def test_refuses_what_is_of_another_kind(self):
        """Checked by the argument's name before C sees it: C would accept any pointer, and drop bits that do not fit."""
        device, scene = self.device, vsplat.Scene.from_arrays(*gaussians())
        views = vsplat.Views.from_arrays([np.zeros((33, 40, 3))] * 2, [camera(), camera(turn=np.pi)])
        model = vsplat.Model.random("micro")
        for name, call in {
                "scene": lambda: device.render(views, camera()), "camera": lambda: device.render(scene, scene),
                "cameras": lambda: device.render_async(scene, [camera(), scene]), "model": lambda: device.reconstruct(scene, views),
                "views": lambda: device.reconstruct(model, views), "start": lambda: device.fit(views, views),
                "like": lambda: vsplat.Scene.from_arrays(*gaussians(), like=views), "other": lambda: scene.append(model),
                "names": lambda: views.prepare(model, names="0001"), "voxels": lambda: device.reconstruct(model, scene, voxels=[0.5]),
                "seed": lambda: vsplat.Model.random("micro", seed=0.5), "width": lambda: scene.orbit(1, width=40.5),
                "background": lambda: device.render(scene, camera(), background=1), "out": lambda: device.render(scene, camera(), out=[1])}.items():
            with self.assertRaisesRegex(TypeError, name):
                call()
        for text, call in {
                "seed is -1: 0 to 18446744073709551615": lambda: vsplat.Model.random("micro", seed=-1),
                "path is 'a.+b.ply', which has a NUL": lambda: vsplat.Scene.load("a\0b.ply"),
                "path is b'a.+b.ply', which has a NUL": lambda: scene.save(b"a\0b.ply"),
                "pictures is 'a.+', which has a NUL": lambda: vsplat.Views.load("a", "a\0"),
                r"names\[1\] is": lambda: views.prepare(model, names=["0", "1\0"]), "device is": lambda: vsplat.Device("cpu\0"),
                "config is": lambda: vsplat.Model.random("micro\0"), "background has 2 numbers: 3": lambda: device.render(scene, camera(), (1, 1)),
                "background has 4 numbers: 3": lambda: device.render(scene, camera(), (1, 1, 1, 1)),
                "center has 2 numbers: 3": lambda: views.prepare(model, center=(0, 0)),
                "up has 4 numbers: 3": lambda: vsplat.Scene.from_arrays(*gaussians(), up=(0, 0, 0, 1)),
                "index is -1": lambda: views.prepare(model).camera(-1), "steps is ": lambda: device.fit(views, scene, steps=1 << 63),
                "background is 'skyish': auto, random, sky": lambda: device.fit(views, scene, background="skyish"),
                "masks is 'none': object, ignore": lambda: device.fit(views, scene, masks="none"),
                "extent is 'room': object, scene, auto": lambda: device.fit(views, scene, extent="room"),
                "supersample is -1": lambda: device.render(scene, camera(), supersample=-1),
                "width is 4294967336": lambda: device.render(scene, camera(width=(1 << 32) + 40)),
                "voxels holds -1": lambda: device.reconstruct(model, views.prepare(model), voxels=[-1])}.items():
            with self.assertRaisesRegex(vsplat.UsageError, text):
                call()
        with self.assertRaisesRegex(vsplat.Error, r"\"quantum\" \(device\)"):
            vsplat.Device("quantum")
        with self.assertRaisesRegex(vsplat.UsageError, "^names nobody: no such view"):
            views.prepare(model, names=["nobody"])
        for made in (lambda: vsplat.Scene("a.ply"), lambda: vsplat.Views(7), lambda: copy.copy(scene), lambda: copy.deepcopy(device),
                     lambda: pickle.dumps(model)):
            with self.assertRaises(TypeError):
                made()
        self.assertEqual(len(scene), 50)

    def test_draws_into_arrays(self):
        scene, background = vsplat.Scene.from_arrays(*gaussians()), (0.2, 0.5, 0.7)
        want = self.device.render(scene, camera(), background)
        frame = np.full((60, 100, 3), 77, np.uint8)
        picture = self.device.render(scene, camera(), background, colour=False, alpha=False, depth=False, out=frame[10:43, 20:60])
        self.assertIsNone(picture.colour)
        np.testing.assert_array_equal(frame[10:43, 20:60], np.floor(want.colour.clip(0, 1) * np.float32(255) + 0.5).astype(np.uint8))
        frame[10:43, 20:60] = 77
        self.assertTrue((frame == 77).all())
        for dtype in (np.uint8, np.float16, np.float32):
            out = np.zeros((33, 40, 4), dtype)
            self.device.render(scene, camera(), background, out=out, premultiplied=True)
            scale = 255 if dtype is np.uint8 else 1
            np.testing.assert_allclose(out[..., 3] / scale, want.alpha, atol=0.6 / 255 if dtype is np.uint8 else 1e-3)
            over = out[..., :3] / scale + (1 - want.alpha[..., None]) * np.float32(background)
            np.testing.assert_allclose(over, want.colour.clip(0, over.max()), atol=0.01)
        frozen = np.zeros((33, 40, 3), np.uint8)
        frozen.flags.writeable = False
        for bad in (np.zeros((40, 33, 3), np.uint8), np.zeros((33, 40, 2), np.uint8), np.zeros((33, 80, 3), np.uint8)[:, ::2],
                    np.zeros((33, 40, 3), np.uint8)[::-1], np.zeros((3, 33, 40), np.uint8).transpose(1, 2, 0), frozen):
            with self.assertRaisesRegex(vsplat.UsageError, "out has"):
                self.device.render(scene, camera(), out=bad)
        with self.assertRaisesRegex(TypeError, "int32"):
            self.device.render(scene, camera(), out=np.zeros((33, 40, 3), np.int32))

    def test_draws_where_surfaces_are(self):
        """Compared with every pixel's Gaussians, one by one, by the definitions."""
        values, at = gaussians(30), camera(turn=0.2)
        scene = vsplat.Scene.from_arrays(*values)
        got = self.device.render(scene, at, (0, 0, 0), also=("expected", "median", "normal", "ids"))
        with np.errstate(invalid="ignore", divide="ignore"):
            np.testing.assert_allclose(got.expected, np.where(got.alpha > 0, got.depth / got.alpha, 0), rtol=1e-6)
        median, normal, ids, unsure = surfaces(values, at)
        self.assertGreater((~unsure).mean(), 0.95)
        sure = ~unsure
        self.assertEqual(len(set(ids[sure].ravel())) > 8, True)
        np.testing.assert_array_equal(got.ids[sure], ids[sure])
        np.testing.assert_allclose(got.median[sure], median[sure], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(got.normal[sure], normal[sure], atol=2e-4)
        self.assertGreater(np.abs(normal).max(), 0.5)
        with self.assertRaisesRegex(vsplat.UsageError, "normals"):
            self.device.render(scene, at, also=["normals"])

    def test_surfels_have_surfaces_but_no_ids(self):
        values = list(gaussians(20))
        values[1] = values[1].copy()
        values[1][:, 2] = 0
        flat = vsplat.Scene.from_arrays(*values)
        info = flat._info()
        info.surfels = 1
        handle = c.c_void_p()
        vsplat._c._call("scene_create", c.byref(info), c.byref(flat.arrays()._struct(20)), c.byref(handle))
        surfels = vsplat.Scene(handle)
        drawn = self.device.render(surfels, camera(), also=("median", "normal"))
        self.assertGreater(np.linalg.norm(drawn.normal, axis=2).max(), 0.5)
        self.assertLessEqual(drawn.normal[..., 2].max(), 1e-6)  # towards the camera
        self.assertGreater(drawn.median.max(), 1)
        with self.assertRaisesRegex(vsplat.UsageError, "surfels"):
            self.device.render(surfels, camera(), also=["ids"])
        with self.assertRaisesRegex(vsplat.Error, "surfels_to_gaussians"):
            surfels.append(vsplat.Scene.from_arrays(*gaussians()))

    def test_files_in_memory(self):
        scene, model = vsplat.Scene.from_arrays(*gaussians()), vsplat.Model.random("micro", seed=3)
        picture = self.device.render(scene, camera(), (0, 0, 0))
        with tempfile.TemporaryDirectory() as folder:
            scene.save(f"{folder}/a.ply")
            model.save(f"{folder}/a.safetensors")
            self.assertEqual(scene.to_bytes(), pathlib.Path(folder, "a.ply").read_bytes())
            self.assertEqual(model.to_bytes(), pathlib.Path(folder, "a.safetensors").read_bytes())
        self.assertEqual(vsplat.Scene.from_bytes(scene.to_bytes()).to_bytes(), vsplat.Scene.from_bytes(bytearray(scene.to_bytes())).to_bytes())
        self.assertEqual(vsplat.Model.from_bytes(model.to_bytes()).info, model.info)
        for format, begin in {"png": b"\x89PNG", "png-alpha": b"\x89PNG", "jpeg": b"\xff\xd8", "exr": b"v/1\x01", "exr-raw": b"v/1\x01"}.items():
            self.assertEqual(picture.to_bytes(format)[:len(begin)], begin)
        with self.assertRaisesRegex(vsplat.UsageError, "format is 'gif'"):
            picture.to_bytes("gif")
        with self.assertRaisesRegex(vsplat.Error, "picture.alpha is null"):
            vsplat.Picture(picture.colour, None, None).to_bytes("exr")

    def test_scenes_in_one_picture(self):
        one, two = vsplat.Scene.from_arrays(*gaussians(seed=1)), vsplat.Scene.from_arrays(*gaussians(seed=2, functions=9))
        move = np.eye(4)
        move[:3, :3] *= 0.5
        move[0, 3] = 1.5
        both = vsplat.Scene.of(one, (two, move))
        self.assertEqual((len(both), both.sh_degree), (100, 2))
        np.testing.assert_array_equal(both.arrays().means[:50], one.arrays().means)
        np.testing.assert_allclose(both.arrays().means[50:], two.arrays().means * 0.5 + [1.5, 0, 0], atol=1e-6)
        near, far = (self.device.render(s, camera(width=120)) for s in (one, both))
        self.assertGreater(np.abs(far.alpha - near.alpha).max(), 0.5)
        both.remove(np.arange(50, 100))
        np.testing.assert_array_equal(self.device.render(both, camera(width=120)).alpha, near.alpha)
        both.remove(both.arrays().means[:, 0] > 0)
        self.assertEqual(len(both), (one.arrays().means[:, 0] <= 0).sum())
        both.crop((-1, -1, -0.2), (1, 1, 0.2))
        self.assertLessEqual(np.abs(both.arrays().means[:, 2]).max(), 0.2)
        both.transform(move)
        self.assertGreater(both.arrays().means[:, 0].min(), 1.2)
        for bad in (np.eye(3), [1]):
            with self.assertRaisesRegex(vsplat.UsageError, r"\[4, 4\] expected"):
                both.transform(bad)
        with self.assertRaisesRegex(vsplat.UsageError, "the scene has"):
            both.remove([len(both)])
        with self.assertRaisesRegex(vsplat.UsageError, "count is 3"):
            both.remove(np.zeros(3, bool))

    def test_jobs(self):
        scene, report, ends = vsplat.Scene.from_arrays(*gaussians()), [], []
        device = vsplat.Device()
        cameras = [camera(turn=0.1 * i) for i in range(3)]
        frames = np.zeros((3, 33, 40, 4), np.uint8)
        job = device.render_async(scene, cameras, out=list(frames), progress=lambda *a: report.append(a), on_end=lambda j: ends.append(j.wait()))
        pictures = job.result()
        self.assertEqual((job.state, ends, len(report)), ("done", ["done"], 3))
        for at, picture, frame in zip(cameras, pictures, frames):
            np.testing.assert_array_equal(picture.colour, self.device.render(scene, at).colour)
            self.assertGreater(frame[..., 3].max(), 100)
        model = vsplat.Model.random("micro", seed=5)
        edge = model.info["image"]
        views = vsplat.Views.from_arrays([np.full((edge, edge, 3), 0.5)] * 2,
                                         [vsplat.Camera(edge, edge, 20, 20, edge / 2, edge / 2, camera(turn=t).w2c) for t in (0, np.pi)])
        given = views.prepare(model)
        made = device.reconstruct_async(model, given, voxels=[3, 21]).result()
        np.testing.assert_array_equal(made.arrays().means, self.device.reconstruct(model, given, voxels=[3, 21]).arrays().means)
        with self.assertRaises(ZeroDivisionError):
            device.reconstruct_async(model, given, progress=lambda *_: 1 / 0).result()
        with self.assertRaises(ZeroDivisionError):
            device.render_async(scene, cameras, on_end=lambda _: 1 / 0).result()
        stopped = device.reconstruct_async(model, given, progress=lambda *_: time.sleep(0.01))
        with self.assertRaises(vsplat.Error) as busy:
            device.render(scene, cameras[0])
        self.assertEqual(busy.exception.status, "busy")
        stopped.cancel()
        with self.assertRaises(vsplat.Error) as cancelled:
            stopped.result()
        self.assertEqual((cancelled.exception.status, stopped.state), ("cancelled", "cancelled"))
        for _ in range(10):  # without references
            device.render_async(scene, cameras)
        gc.collect()
        last = device.render_async(scene, cameras)
        self.assertEqual(last.wait(), "done")

    def test_ends_with_a_job(self):
        """A program that ends while a job runs: the job is cancelled, and no callback reaches an interpreter that no longer exists."""
        program = f"""if True:
            import sys; sys.path.insert(0, {str(ROOT / "examples" / "python")!r})
            import numpy as np, vsplat
            device, model = vsplat.Device(), vsplat.Model.random("micro", seed=5)
            edge, back = model.info["image"], np.diag([-1.0, 1, -1, 1])
            front = np.eye(4); front[2, 3] = back[2, 3] = 2
            cameras = [vsplat.Camera(edge, edge, 20, 20, edge / 2, edge / 2, w2c) for w2c in (front, back)]
            given = vsplat.Views.from_arrays([np.full((edge, edge, 3), 0.5)] * 2, cameras).prepare(model)
            for _ in range(20):
                device.reconstruct_async(model, given, progress=lambda *_: None)
            print("ends")"""
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "ends\n", ""))

    def test_threads_stop_calls_and_run_beside_them(self):
        scene = vsplat.Scene.from_arrays(*gaussians(2000))
        device, stopped = vsplat.Device(), []

        def draws():
            try:
                while True:
                    device.render(scene, camera(400, 330))
            except vsplat.Error as e:
                stopped.append(e.status)

        thread = threading.Thread(target=draws)
        thread.start()
        until = time.monotonic() + 60
        while thread.is_alive() and time.monotonic() < until:
            time.sleep(0.002)
            device.cancel()
        thread.join(1)
        self.assertEqual(stopped, ["cancelled"])

    def test_gives_back_what_it_took(self):
        for _ in range(20):
            vsplat.Scene.from_arrays(*gaussians()).arrays()
        gc.collect()

    def test_gradients_are_those_of_differences(self):
        values, weights = gaussians(8), np.random.default_rng(3).normal(size=(33, 40, 3))

        def loss(arrays):
            return float((self.device.render(vsplat.Scene.from_arrays(*arrays), camera()).colour.astype(float) * weights).sum())

        g, pose = self.device.render_backward(vsplat.Scene.from_arrays(*values), camera(), colour=weights)
        self.assertEqual(pose.shape, (6,))
        got = (g.means, g.scales, g.rotations, g.opacities, g.sh)
        r = np.random.default_rng(4)
        along = [r.normal(size=a.shape) for a in values]
        for kind in (3, 4):  # opacities, which move edges little, and colours, which move none
            h = 1e-3
            moved = [[a + (s * h * d if i == kind else 0) for i, (a, d) in enumerate(zip(values, along))] for s in (1, -1)]
            slope = (loss(moved[0]) - loss(moved[1])) / (2 * h)
            self.assertAlmostEqual((got[kind] * along[kind]).sum() / slope, 1, delta=0.02)

    def test_gradients_are_those_of_differences_where_no_edge_is(self):
        """In the way that vsplat/render.h recommends: Gaussians that cover the whole picture."""
        at, r = vsplat.Camera(96, 96, 200, 200, 48, 48), np.random.default_rng(6)
        at.w2c = np.eye(4)
        at.w2c[2, 3] = 4
        values = [r.uniform(-0.3, 0.3, (4, 3)), 1.5 * r.uniform(0.8, 1.2, (4, 3)), r.normal(size=(4, 4)), np.full(4, 0.5), r.uniform(0.2, 1, (4, 1, 3))]
        weights = r.uniform(0, 1, (96, 96, 3)) + np.linspace(0, 1, 96)[:, None]

        def loss(arrays):
            picture = self.device.render(vsplat.Scene.from_arrays(*arrays, near=0.1), at, supersample=1)
            self.assertGreater(picture.alpha.min(), 0.5)
            return float((picture.colour.astype(float) * weights).sum())

        g, _ = self.device.render_backward(vsplat.Scene.from_arrays(*values, near=0.1), at, colour=weights)
        for kind, got in enumerate((g.means, g.scales, g.rotations, g.opacities, g.sh)):
            along = r.normal(size=values[kind].shape)
            along /= np.linalg.norm(along)
            moved = [loss([a + (step * along if i == kind else 0) for i, a in enumerate(values)]) for step in (1e-2, -1e-2)]
            self.assertAlmostEqual((moved[0] - moved[1]) / 2e-2 / (got * along).sum(), 1, delta=0.01)


@unittest.skipIf(torch is None, "needs torch (Debian: python3-torch)")
class AgainstPyTorch(unittest.TestCase):
    """Pictures and gradients of the example's autograd.Function, compared with the specification's."""

    def test_draws_and_differentiates_as_the_specification(self):
        import fit_torch
        import splat3d_reference as reference
        device, view = vsplat.Device(), camera(turn=0.3)
        mine = [torch.tensor(a, dtype=torch.float32, requires_grad=True) for a in gaussians(30)]
        theirs = [t.detach().double().requires_grad_() for t in mine]
        c2w = torch.tensor(np.linalg.inv(view.w2c))
        k = torch.tensor([[view.fx, 0, view.cx], [0, view.fy, view.cy], [0, 0, 1]], dtype=torch.float64)
        want = reference.render(reference.Gaussians(*theirs), c2w, k, view.width, view.height, torch.tensor([0.2, 0.5, 0.7]).double())
        got = fit_torch.draw(device, view, *mine, background=(0.2, 0.5, 0.7))
        torch.manual_seed(2)
        weights = [torch.randn_like(p) for p in got]
        for a, b in zip(got, want):
            self.assertLess((a - b).abs().max().item(), 1e-4)
        sum((a * w).sum() for a, w in zip(got, weights)).backward()
        sum((b * w).sum() for b, w in zip(want, weights)).backward()
        for a, b in zip(mine, theirs):
            self.assertGreater(b.grad.abs().max().item(), 0.1)
            self.assertLess(((a.grad - b.grad).abs().max() / b.grad.abs().max()).item(), 1e-4)

    def test_example_fits(self):
        import fit_torch
        self.assertLess(fit_torch.main(steps=60), 0.01)

    def test_takes_tensors(self):
        values = [torch.tensor(a, dtype=torch.float32) for a in gaussians()]
        picture = vsplat.Device().render(vsplat.Scene.from_arrays(*values), camera())
        np.testing.assert_array_equal(picture.colour, vsplat.Device().render(vsplat.Scene.from_arrays(*gaussians()), camera()).colour)


if __name__ == "__main__":
    unittest.main()
