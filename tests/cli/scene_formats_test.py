"""Scenes in several formats on the command line: read by content, written by ending."""
import pathlib
import shutil
import struct

import support

GOLDEN = pathlib.Path(__file__).resolve().parent.parent / "golden" / "scenes"


class SceneFormats(support.Case):
    def render(self, scene, *more):
        folder = self.path("pictures")
        _, said = self.succeeds("render", scene, "--cameras", "orbit:1", "--images", folder, "--size", "32x32", "--overwrite", *more)
        return support.read_png(self.path("pictures", "0000.png"))[2], said

    def test_every_format_is_drawn(self):
        for name in ("plain.splat", "version1_degree1.spz", "version2_degree0.spz", "version3_degree3.spz", "version4_degree2.spz", "degree1.compressed.ply", "degree2.ply"):
            picture, _ = self.render(GOLDEN / name)
            other = self.path("scene.dat")  # its content says what it is
            shutil.copy(GOLDEN / name, other)
            self.assertEqual(self.render(other)[0], picture, name)

    def test_degree_4_is_reported_of_once(self):
        for name in ("degree4.ply", "version4_degree4.spz"):
            _, said = self.render(GOLDEN / name)
            self.assertEqual(said.count("degree 4: they are drawn up to degree 3"), 1, said)
        _, said = self.render(GOLDEN / "degree3.ply")
        self.assertNotIn("they are drawn up to degree", said)

    def test_a_fit_starts_from_any_format_and_makes_any(self):
        start, made = self.path("start.ply"), self.path("made.spz")
        rest = 3 * 24
        names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"] + [f"f_rest_{i}" for i in range(rest)]
        names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex 20\n" + "".join(f"property float {n}\n" for n in names) + "end_header\n"
        rows = [struct.pack(f"<{len(names)}f", *(0.03 * i, 0.02 * i, 0.1), 0.5, 0.4, 0.3, *[0.01] * rest, 1, -2, -2, -2, 1, 0, 0, 0) for i in range(20)]
        pathlib.Path(start).write_bytes(head.encode() + b"".join(rows))
        fit = ("fit", self.views, "--steps", 2, "--size", 16, "--object")
        _, said = self.succeeds(*fit, "--start", start, "--output", made)
        self.assertEqual(said.count("the start's spherical harmonics have degree 4"), 1, said)
        self.assertIn("made.spz: positions are rounded to", said)
        _, said = self.succeeds(*fit, "--start", made, "--output", self.path("again.ply"))
        self.assertNotIn("harmonics have degree", said)
        self.assertIn(b"comment SH degree: 3", pathlib.Path(self.path("again.ply")).read_bytes()[:300])

    def test_an_unknown_ending_is_refused_before_any_work(self):
        for command in (("fit", "nowhere", "--start", "points"), ("reconstruct", "nowhere")):
            for name in ("scene.obj", "scene", "scene.ply.gz"):
                self.refuses(2, ".spz (SPZ)", *command, "--output", self.path(name))
        self.refuses(1, "a scene is expected: .ply (3DGS PLY)", "render", __file__, "--cameras", "orbit:1", "--images", self.path("x"))


if __name__ == "__main__":
    support.main()
