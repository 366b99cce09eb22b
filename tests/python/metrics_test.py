"""vsplat.compare and vsplat.psnr_cc against NumPy."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "examples" / "python"))

import numpy as np  # noqa: E402
import vsplat  # noqa: E402


class Metrics(unittest.TestCase):
    def test_compares(self):
        r = np.random.default_rng(3)
        truth = r.uniform(0, 1, (16, 20, 3))
        psnr, ssim = vsplat.compare(np.clip(truth + 0.1, 0, 2), truth)
        self.assertAlmostEqual(psnr, -10 * np.log10(np.mean((np.clip(truth + 0.1, 0, 1) - truth) ** 2)), places=4)
        self.assertTrue(0 < ssim < 1)
        self.assertEqual(vsplat.compare(truth, truth)[1], 1)

    def test_compares_after_colour_correction(self):
        """psnr_cc against numpy's least squares: where a map exists, where noise hides it, and where drawn colours do not determine it."""
        def reference(picture, truth):
            x, y = np.float32(np.clip(picture, 0, 1)).reshape(-1, 3).astype(float), np.float32(np.clip(truth, 0, 1)).reshape(-1, 3).astype(float)
            ones = np.c_[x, np.ones(len(x))]
            error = np.clip(ones @ np.linalg.lstsq(ones, y, rcond=None)[0], 0, 1) - y
            return -10 * np.log10(np.mean(error ** 2))
        r = np.random.default_rng(5)
        factors, offsets = np.array([[0.7, 0.1, 0.0], [-0.1, 0.9, 0.05], [0.0, 0.2, 1.3]]), np.array([0.1, -0.05, 0.02])
        for height, width in ((1, 1), (1, 3), (7, 1), (16, 20), (31, 17)):
            picture = r.uniform(0, 1, (height, width, 3))
            truth = picture @ factors.T + offsets
            noisy = truth + r.normal(0, 0.05, truth.shape)
            inside = 0.2 + 0.5 * picture  # no value is clamped: the map is found
            self.assertGreater(vsplat.psnr_cc(picture, inside), 90)
            if height * width < 5:  # a map takes each of so few colours to any other
                self.assertGreater(vsplat.psnr_cc(picture, noisy), 90)
                continue
            self.assertAlmostEqual(vsplat.psnr_cc(picture, noisy), reference(picture, noisy), places=4)
            self.assertGreater(vsplat.psnr_cc(picture, noisy), vsplat.compare(picture, noisy)[0])
        grey = np.repeat(r.uniform(0, 1, (9, 9, 1)), 3, axis=2)
        noisy = grey * (0.5, 0.7, 0.9) + r.normal(0, 0.02, grey.shape)
        self.assertAlmostEqual(vsplat.psnr_cc(grey, noisy), reference(grey, noisy), places=4)
        self.assertAlmostEqual(vsplat.psnr_cc(np.full((9, 9, 3), 0.3), noisy), reference(np.full((9, 9, 3), 0.3), noisy), places=4)
        noisy[4, 4, 1] = np.nan
        self.assertTrue(np.isnan(vsplat.psnr_cc(grey, noisy)))


if __name__ == "__main__":
    unittest.main()
