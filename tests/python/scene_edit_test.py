"""examples/python: scenes edited, reduced, described and compared, beside numpy."""
import os
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "examples" / "python"))

import numpy as np  # noqa: E402
import vsplat  # noqa: E402


def camera():
    w2c = np.eye(4)
    w2c[2, 3] = 2
    return vsplat.Camera(40, 33, 45, 44, 19.5, 17, w2c)


def gaussians(count=50, functions=4, seed=1):
    r = np.random.default_rng(seed)
    return (r.uniform(-0.5, 0.5, (count, 3)).astype(np.float32), r.uniform(0.03, 0.12, (count, 3)), r.normal(size=(count, 4)),
            r.uniform(0.05, 0.9, count).astype(np.float32), r.normal(size=(count, functions, 3)) * 0.5)


class SceneEdit(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = vsplat.Device()

    def test_scenes_edited_described_and_compared(self):
        scene, given = vsplat.Scene.from_arrays(*gaussians(seed=4)), gaussians(seed=4)
        means, opacities = given[0], given[3]
        numbers = scene.statistics()
        np.testing.assert_array_equal(numbers["low"], means.min(axis=0))
        self.assertEqual((numbers["count"], numbers["transparent"]), (len(means), (opacities < 0.1).sum()))
        kept = (np.abs(means) <= 0.4).all(axis=1) & (opacities >= 0.3)
        self.assertTrue(0 < kept.sum() < len(means))
        result = scene.edit(box=((-0.4,) * 3, (0.4,) * 3), min_opacity=0.3, to_axes="RUF", scale=2, translation=(0, 0, 1))
        self.assertEqual((result["count"], result["mirrored"]), (kept.sum(), True))
        self.assertEqual(result["outside_box"] + result["below_opacity"], (~kept).sum())
        np.testing.assert_allclose(scene.arrays().means, 2 * means[kept] * [1, -1, 1] + [0, 0, 1], atol=1e-6)
        self.assertEqual(scene.difference(scene)["sh"], 0)
        before = vsplat.Scene.of(scene)
        scene.edit(translation=(0.01, 0, 0))
        self.assertAlmostEqual(scene.difference(before)["means_rms"], 0.01, places=6)
        self.device.keep_visible(scene, 3)
        self.assertEqual(len(scene), 3)
        self.device.keep_visible(scene, 2, [camera()])
        self.assertEqual(len(scene), 2)
        with self.assertRaisesRegex(vsplat.Error, "2 and .* Gaussians"):
            scene.difference(before)
        with self.assertRaisesRegex(vsplat.UsageError, "XYZ"):
            scene.edit(from_axes="XYZ")
        with tempfile.TemporaryDirectory() as folder:
            before.save(f"{folder}/a.spz", spz_version=3)
            self.assertEqual(vsplat.describe_scene_file(f"{folder}/a.spz"),
                             {"format": "spz", "title": "SPZ", "version": "version 3", "axes": "RUB", "bytes": os.path.getsize(f"{folder}/a.spz")})

    def test_a_surface_as_triangles(self):
        """A ball of flat, opaque Gaussians of radius 0.4."""
        r = np.random.default_rng(3)
        n = r.normal(size=(3000, 3))
        n /= np.linalg.norm(n, axis=1)[:, None]
        turns = np.stack([1 + n[:, 2], -n[:, 1], n[:, 0], np.zeros(3000)], axis=1)  # from z to the normal
        sh = (n[:, None, :] * 0.4 / 0.28209479177387814).astype(np.float32)
        scene = vsplat.Scene.from_arrays(0.4 * n, np.tile([0.02, 0.02, 0.002], (3000, 1)), turns, np.full(3000, 0.95), sh)
        result = []
        mesh = self.device.mesh(scene, voxels=32, progress=lambda stage, done: result.append(stage))
        self.assertEqual(list(dict.fromkeys(result)), ["surface", "fusion", "triangles"])
        positions, normals, colours, triangles = mesh.arrays()
        away = np.linalg.norm(positions, axis=1)
        self.assertLess(np.abs(away - 0.4).mean(), 0.008)
        self.assertGreater((normals * positions).sum(axis=1).min(), 0)
        self.assertLess(np.abs(colours - 0.5 - positions).mean(), 0.02)
        self.assertEqual(len(np.unique(triangles)), len(positions))
        few = self.device.mesh(scene, [camera()], voxels=32, max_triangles=100, depth="expected").arrays()
        self.assertTrue(50 < len(few[3]) <= 100)
        self.assertLess(few[0][:, 2].max(), 0.1)  # only its front was seen
        part = self.device.mesh(scene, voxels=16, center=(0.4, 0, 0), scale=0.2).arrays()[0]
        self.assertLess(np.abs(part - [0.4, 0, 0]).max(), 0.12)
        with tempfile.TemporaryDirectory() as folder:
            mesh.save(f"{folder}/m.glb")
            self.assertEqual(pathlib.Path(f"{folder}/m.glb").read_bytes()[:4], b"glTF")
            with self.assertRaisesRegex(vsplat.UsageError, "m.obj"):
                mesh.save(f"{folder}/m.obj")
        with self.assertRaisesRegex(vsplat.Error, "stopped"):
            self.device.mesh(scene, progress=lambda stage, done: False)
        for wrong, words in (({"voxels": 15}, "voxels"), ({"least_part": 2}, "least_part"), ({"center": (0, 0, 0)}, "scale"), ({"scale": 1}, "center"),
                             ({"cameras": []}, "num_cameras"), ({"depth": "first"}, "depth")):
            with self.assertRaisesRegex(vsplat.UsageError, words):
                self.device.mesh(scene, **wrong)
        with self.assertRaisesRegex(vsplat.Error, "no surface"):
            self.device.mesh(scene, center=(9, 9, 9), scale=1)


if __name__ == "__main__":
    unittest.main()
