"""examples/python: scenes saved and loaded in every format, and spherical harmonics of degree 4."""
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "examples" / "python")]

import numpy as np  # noqa: E402
import vsplat  # noqa: E402


def camera():
    w2c = np.eye(4)
    w2c[2, 3] = 2
    return vsplat.Camera(40, 33, 45, 44, 19.5, 17, w2c)


def gaussians(count=50, functions=4):
    r = np.random.default_rng(1)
    return (r.uniform(-0.5, 0.5, (count, 3)), r.uniform(0.03, 0.12, (count, 3)), r.normal(size=(count, 4)), r.uniform(0.2, 0.9, count),
            r.normal(size=(count, functions, 3)) * 0.5)


class SceneFormats(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = vsplat.Device()

    def test_scenes_are_saved_in_every_format(self):
        formats = vsplat.scene_formats()
        self.assertLessEqual({"ply", "compressed-ply", "spz", "sog", "glb", "gltf", "splat"}, {f["name"] for f in formats})
        scene = vsplat.Scene.from_arrays(*gaussians(functions=25))
        self.assertEqual(scene.sh_degree, 4)
        with tempfile.TemporaryDirectory() as folder:
            for f in formats:
                self.assertEqual(f["lossless"] and f["sh_degree"] == 4, not scene.losses(f["name"]), f)
                if not f["writes"]:
                    continue
                path = f"{folder}/a{f['endings'][0]}"
                scene.save(path)
                held = scene.to_bytes(f["name"])
                with open(path, "rb") as file:
                    self.assertEqual(file.read(), held, "the ending names the format")
                for again in (vsplat.Scene.load(path), vsplat.Scene.from_bytes(held)):
                    self.assertEqual((len(again), again.sh_degree), (50, f["sh_degree"]), f)
                scene.save(f"{folder}/unnamed", format=f["name"])
                with open(f"{folder}/unnamed", "rb") as file:
                    self.assertEqual(file.read(), held)
            with self.assertRaisesRegex(vsplat.UsageError, r"a\.obj.*\.spz \(SPZ\)"):
                scene.save(f"{folder}/a.obj")
        self.assertEqual([scene.to_bytes("spz", spz_version=v)[:2] for v in (2, 3, 4)], [b"\x1f\x8b", b"\x1f\x8b", b"NG"])
        for wrong in (1, 5, -1):
            with self.assertRaisesRegex(vsplat.UsageError, "spz_version"):
                scene.to_bytes("spz", spz_version=wrong)
        for call in (scene.losses, scene.to_bytes):
            with self.assertRaisesRegex(vsplat.UsageError, '"obj".*ply, compressed-ply'):
                call("obj")

    def test_degree_4_is_drawn_as_degree_3(self):
        values = gaussians(functions=25)
        pictures = [self.device.render(vsplat.Scene.from_arrays(*values[:4], sh), camera()).colour for sh in (values[4], values[4][:, :16])]
        np.testing.assert_array_equal(*pictures)
        by = np.ones((33, 40, 3), np.float32)
        gradients = [self.device.render_backward(vsplat.Scene.from_arrays(*values[:4], sh), camera(), colour=by)
                     for sh in (values[4], values[4][:, :16])]
        found = [of_gaussians.sh for of_gaussians, _ in gradients]
        np.testing.assert_array_equal(found[0][:, :16], found[1])
        np.testing.assert_array_equal(found[0][:, 16:], 0)


if __name__ == "__main__":
    unittest.main()
