"""examples/python: the module against the C library that $VSPLAT_LIBRARY names, and where PyTorch is there, against the specification."""
import gc
import pathlib
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

    def test_compares(self):
        r = np.random.default_rng(3)
        truth = r.uniform(0, 1, (16, 20, 3))
        psnr, ssim = vsplat.compare(np.clip(truth + 0.1, 0, 2), truth)
        self.assertAlmostEqual(psnr, -10 * np.log10(np.mean((np.clip(truth + 0.1, 0, 1) - truth) ** 2)), places=4)
        self.assertTrue(0 < ssim < 1)
        self.assertEqual(vsplat.compare(truth, truth)[1], 1)

    def test_cameras_look(self):
        looking = vsplat.Camera.looking_at((1, 2, 3), (1, 2, -4), up=(0, 1, 0))
        np.testing.assert_allclose(looking.w2c @ [1, 2, 3, 1], [0, 0, 7, 1], atol=1e-12)
        self.assertLess((looking.w2c @ [1, 3, 3, 1])[1], 0)  # up is up
        for target, up in (((1, 2, -4), (0, 1, 0)), ((1, 5, -4), (0, 1, 0)), ((1, 2, 3), (0, 0, 0))):
            with self.assertRaisesRegex(vsplat.Error, "does not lie along the view"):
                vsplat.Camera.looking_at(target, (1, 2, -4), up=up)

    def test_refines(self):
        truth = vsplat.Scene.from_arrays(*gaussians(20))
        cameras = [camera(turn=0.05 * i) for i in range(5)]
        views = vsplat.Views.from_arrays([self.device.render(truth, at, background=(0, 0, 0)).colour.clip(0, 1) for at in cameras], cameras)
        start = vsplat.Scene.from_arrays(*gaussians(20)[:4], np.zeros((20, 4, 3)))
        told = []
        out = self.device.refine(views, start, steps=6, progress=lambda phase, share: told.append((phase, share)))
        self.assertEqual(told[-1][0], "refining")
        self.assertEqual(told[-1][1], 1)
        self.assertEqual(len(out), 20)
        with self.assertRaises(ZeroDivisionError):
            self.device.refine(views, start, steps=6, progress=lambda *_: 1 / 0)
        del told[:]
        self.device.refine(views, start, steps=6, progress=lambda phase, share: told.append(phase) or False)
        self.assertEqual(len(told), 1)

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
        told = []
        self.device.prepare(model, views=2)
        scene = self.device.reconstruct(model, given, voxels=[3, 21], progress=lambda *a: told.append(a))
        self.assertEqual((len(scene), told[0][0]), (6, "encoder"))
        self.assertEqual(len(scene.orbit(5)), 5)
        with self.assertRaises(vsplat.Error) as caught:
            self.device.reconstruct(model, given, progress=lambda stage, done: False)
        self.assertEqual(caught.exception.status, "cancelled")
        with self.assertRaisesRegex(ZeroDivisionError, "division"):  # what a callback raises comes out again
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
        for kind in (3, 4):  # opacities and colours, by which a picture has no edges
            h = 1e-3
            moved = [[a + (s * h * d if i == kind else 0) for i, (a, d) in enumerate(zip(values, along))] for s in (1, -1)]
            slope = (loss(moved[0]) - loss(moved[1])) / (2 * h)
            self.assertAlmostEqual((got[kind] * along[kind]).sum() / slope, 1, delta=0.02)


@unittest.skipIf(torch is None, "needs torch (Debian: python3-torch)")
class AgainstPyTorch(unittest.TestCase):
    """Pictures and gradients of the example's autograd.Function against the specification's."""

    def test_draws_and_differentiates_as_the_specification(self):
        import fit_torch
        import vsplat_reference as reference
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
