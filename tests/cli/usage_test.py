"""Invalid requests: exit code 2, a message that names the option, nothing written."""
import os
import shutil

import support


class Usage(support.Case):
    def test_commands(self):
        out, err = self.succeeds()  # no arguments: lists the sub-commands
        self.assertEqual(out, self.succeeds("--help")[0])
        self.assertEqual(err, "")
        self.refuses(2, ["unknown command devcies", "devices"], "devcies")
        self.refuses(2, ["--modle", "did you mean --model"], "reconstruct", self.views, "--modle", self.model)
        self.refuses(2, "--output", *self.reconstruct()[:4])
        self.refuses(2, "seed", "init", "micro", "--output", self.path("x"))

    def test_names_that_other_programs_use(self):
        support.write_scene(self.path("scene.ply"), [((0, 0, 0), (1, 0, 0), 0.1, 0.9)])
        drawn = ("--cameras", "orbit:1", "--size", "16x16", "--quiet")
        self.succeeds("render", "--input", self.path("scene.ply"), *drawn, "--images", self.path("a"))
        self.succeeds("render", "--input=" + self.path("scene.ply"), *drawn, "--images", self.path("b"))
        self.succeeds("init", "micro", "--seed", 1, "--out", self.path("m.safetensors"), "--quiet")
        self.succeeds("init", "micro", "--seed", 1, "--output-path=" + self.path("n.safetensors"), "--quiet")
        self.assertTrue(os.path.exists(self.path("a", "0000.png")) and os.path.exists(self.path("n.safetensors")))
        self.refuses(2, ["--steps", "whole number"], "fit", self.views, "--start", "random", "--out", self.path("x.ply"), "--iterations", "many")
        self.refuses(2, "unknown arguments --iterations, 3", "render", self.path("scene.ply"), "--iterations", 3)  # render has no steps
        # After a double dash everything is a name, whatever it looks like.
        self.refuses(1, "--input", "render", *drawn, "--images", self.path("c"), "--", "--input")

    def test_earlier_names(self):
        self.assertEqual(self.succeeds("help", "refine"), self.succeeds("help", "fit"))
        self.refuses(2, "fit needs --output", "refine", self.views)
        self.refuses(2, ["--crop", "squash"], *self.reconstruct("--fit", "squash"))
        overview, _ = self.succeeds("--help")
        self.assertNotIn("refine", overview)

    def test_the_nearest_name(self):
        for given, meant in (("--ouput", "--output"), ("--outptu", "--output"), ("--refin", "--refine"), ("--centr", "--center"), ("--autoframe", "--auto-frame")):
            self.refuses(2, [f"unknown argument {given}", f"did you mean {meant}?"], "reconstruct", self.views, given)
        for given in ("--zzz", "--gpu"):
            self.assertNotIn("did you mean", self.refuses(2, f"unknown argument {given}", "reconstruct", self.views, given))

    def test_turntables_are_webp_or_gif(self):
        for name in ("turn.avi", "turn.mp4"):
            self.refuses(2, [name, ".webp or .gif", "ffmpeg -framerate 12 -i frames/%04d.png"],
                         *self.reconstruct("--render", "orbit:2", "--turntable", self.path(name), "--fps", "12"))
        gif = ("--render", "orbit:2", "--turntable", self.path("turn.gif"))
        self.refuses(2, "turn.gif", *self.reconstruct(*gif, "--fps", "60"))
        self.refuses(2, "--quality", *self.reconstruct(*gif, "--quality", "80"))

    def test_help(self):
        for command in ([], ["devices"], ["init"], ["weights"], ["weights", "info"], ["weights", "convert"], ["reconstruct"], ["render"], ["bench"]):
            out, err = self.succeeds(*command, "--help")
            self.assertIn("Example", out)
            self.assertEqual(err, "")
        out, _ = self.succeeds("--version")
        self.assertRegex(out, r"^vsplat \d+\.\d+\.\d+\n$")

    def test_pictures_need_each_other(self):
        self.refuses(2, ["--render", "--images"], *self.reconstruct("--render", "orbit:2"))
        self.refuses(2, ["--render", "--images"], *self.reconstruct("--images", self.path("x")))
        self.refuses(2, "--images", "render", "scene.ply", "--cameras", "orbit:2")
        self.refuses(2, "--cameras", "render", "scene.ply", "--images", self.path("x"))
        self.refuses(2, "--format exr", *self.reconstruct("--exr-raw"))
        drawn = ("render", "scene.ply", "--cameras", "orbit:2")
        self.refuses(2, ["--sheet", "--turntable", "--compare", "--write-cameras"], *drawn)
        self.refuses(2, "--images", *drawn, "--background", "transparent", "--sheet", self.path("x.png"))
        self.refuses(2, "JPEG", *drawn, "--background", "transparent", "--images", self.path("x"), "--format", "jpg")
        self.refuses(2, "--exr-raw", *drawn, "--background", "transparent", "--images", self.path("x"), "--format", "exr", "--exr-raw")
        self.refuses(2, "--render", *self.reconstruct("--sheet", self.path("x.png")))
        self.refuses(2, "--images", *drawn, "--format", "jpg", "--sheet", self.path("x.png"))
        self.refuses(2, "--turntable", *drawn, "--images", self.path("x"), "--fps", "3")
        self.refuses(2, "--format jpg", *drawn, "--images", self.path("x"), "--quality", "80")
        self.refuses(2, "--compare", *drawn, "--images", self.path("x"), "--differences", self.path("y"))

    def test_values_of_pictures(self):
        for option, *values in (("--quality", "0", "101", "1.5", "x"), ("--fps", "0", "0.01", "101", "-3", "x"), ("--sheet", "x.jpg", "x"),
                                ("--turntable", "x.gif2", "x.WEBP2")):
            for value in values:
                with self.subTest(option=option, value=value):
                    more = [] if option == "--turntable" else ["--turntable", self.path("x.webp")]
                    self.refuses(2, option, "render", "scene.ply", "--cameras", "orbit:2", *more, option, value)
        for cameras in ("path:", "path:x", "path:x:", "path::3", "path:x:0", "path:x:-1", "path:x:1.5", "path:x:10001", "path:3"):
            with self.subTest(cameras=cameras):
                self.refuses(2, ["path:CAMERAS:N", cameras], "render", "scene.ply", "--cameras", cameras, "--images", self.path("x"))

    def test_values(self):
        for option, *values in (("--center", "1,2", "1,2,3,4", "1,2,x", "1,,2", "nan,0,0", "0,0,inf", "1, 2, 3", ""),
                                ("--scale", "0", "-1", "x", "nan", "1e999", "1e-60", "1e60", "2 "),
                                ("--near", "0", "-0.1", "z", "1e60"),
                                ("--background", "255,255,255", "1,1", "-1,0,0", "pinkish", "#12345", "#12345g", "#1234567"), ("--size", "0x5", "5", "5x", "5x5x5", "-5x5", "1e9x1"),
                                ("--crop", "squash"), ("--format", "gif"), ("--views", ",", "a,,b"), ("--selection-seed", "-1", "x", "1.5"),
                                ("--assume-selected", "0", "1.1", "-1"), ("--up", "0,0,0"), ("--orbit-radius", "0", "-2", "1e-60"),
                                ("--orbit-elevation", "90", "-100"), ("--kernels", "fpga"), ("--gemm", "mkl"), ("--max-memory", "0", "-3", "nan", "inf", "1x", "0x10", " 1"),
                                ("--render", "orbit:0", "orbit:", "orbit:-3", "orbit:x")):
            for value in values:
                more = ["--images", self.path("pictures")] if option == "--render" else []
                with self.subTest(option=option, value=value):
                    if value:
                        self.refuses(2, option.lstrip("-") if option != "--render" else "orbit", *self.reconstruct(option, value, *more))
                    self.refuses(2, option.lstrip("-") if option != "--render" else "orbit", *self.reconstruct(f"{option}={value}", *more))

    def test_options_that_would_change_nothing(self):
        for given in (("--size", "8x8"), ("--background", "red"), ("--format", "jpg")):
            self.refuses(2, [given[0], "--render"], *self.reconstruct(*given))
        for given in (("--orbit-radius", "3"), ("--orbit-elevation", "20")):
            self.refuses(2, [given[0], "orbit:N"], *self.reconstruct(*given))
            self.refuses(2, [given[0], "orbit:N"], "render", "scene.ply", "--cameras", self.views, "--images", self.path("x"), *given)
        self.refuses(2, ["--up", "orbit:N"], "render", "scene.ply", "--cameras", self.views, "--images", self.path("x"), "--up", "0,0,1")

    def test_scenes_are_written_by_their_ending(self):
        for name in ("x.obj", "x.ksplat", "x.ply.gz", "x"):
            self.refuses(2, ["--output", name, ".ply (3DGS PLY)", ".spz (SPZ)"], "reconstruct", self.views, "--model", self.model, "--output", self.path(name))
        self.refuses(2, ["--write-cameras", ".json"], "render", "scene.ply", "--cameras", "orbit:2", "--write-cameras", self.path("x.txt"))
        self.succeeds("reconstruct", self.views, "--model", self.model, "--output", self.path("X.PLY"))

    def test_values_that_are_empty(self):
        self.refuses(2, "--center", *self.reconstruct("--center", ""))      # not as if it were not given
        self.refuses(2, "--views", *self.reconstruct("--views", "", "--quiet"))
        self.refuses(2, "--model has no value: --output follows", "reconstruct", self.views, "--model", "--output", self.path("x.ply"))
        self.refuses(2, "--crop has no value: -o follows", "reconstruct", self.views, "--fit", "-o", self.path("x.ply"))
        self.refuses(2, "--time needs --refine", "reconstruct", self.views, "--time", 30, "--output", self.path("x.ply"))
        self.refuses(2, "--model= has no value", "reconstruct", self.views, "--model=", "--output", self.path("x.ply"))
        self.refuses(2, "is empty", "", "x")

    def test_views_that_are_not_there(self):
        self.refuses(2, ["nobody"], *self.reconstruct("--views", "0,nobody"))
        self.refuses(2, ["@7"], *self.reconstruct("--views", "@7"))
        self.refuses(2, ["0"], *self.reconstruct("--views", "0,0"))

    def test_configuration(self):
        self.refuses(2, "huge", "init", "huge", "--seed", 1, "--output", self.path("x"))
        self.refuses(2, "no field", "init", "micro", "--seed", 1, "--set", "depth=3", "--output", self.path("x"))
        self.refuses(2, "patch", "init", "micro", "--seed", 1, "--set", "patch=5", "--output", self.path("x"))
        for seed in ("-1", "x", "18446744073709551616"):
            self.refuses(2, "--seed", "init", "micro", "--seed", seed, "--output", self.path("x"))

    def test_conversion(self):
        self.refuses(2, "--dtype", "weights", "convert", self.model, "--output", self.path("x"))
        self.refuses(2, "--output", "weights", "convert", self.model, "--dtype", "f16")
        self.refuses(2, "bf16", "weights", "convert", self.model, "--dtype", "bf16", "--output", self.path("x"))
        self.refuses(2, "read", "weights", "convert", self.model, "--dtype", "f16", "--output", self.model, "--overwrite")

    def test_one_output_twice(self):
        self.refuses(2, "twice", *self.reconstruct("--profile", self.path("out.ply")))
        shutil.copy(self.model, self.path("model.ply"))
        self.refuses(2, "read", "reconstruct", self.views, "--model", self.path("model.ply"), "--output", self.path("model.ply"), "--overwrite")
        for path in (self.views, self.path("views", "images", "1.png")):
            self.refuses(2, "read", *self.reconstruct("--profile", path, "--overwrite"))
        self.succeeds(*self.reconstruct("--write-views", self.path("seen")))
        self.refuses(2, "read", "reconstruct", self.path("seen"), "--model", self.model, "--output", self.path("x.ply"),
                     "--write-views", self.path("seen"), "--overwrite")

    def test_numbers_may_begin_with_a_minus(self):
        views = self.make_views("moved", centre=(-1.0, 2.0, -0.5))
        for arguments in (("--center", "-1,2,-0.5"), ("--center=-1,2,-0.5",), ("--center", "-1,2,-.5", "--up", "-0,-1,0")):
            out, err = self.succeeds("reconstruct", views, "--model", self.model, "--output", self.path("out.ply"), *arguments, "--overwrite")
            self.assertIn("(-1, 2, -0.5)", err)


if __name__ == "__main__":
    support.main()
