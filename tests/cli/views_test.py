"""Lists of views as users have them: pictures elsewhere, sets in parts, single bad views, wrong masks."""
import json
import os
import pathlib
import shutil
import struct
import subprocess

import support

SPLATS = [((0.1 * i - 0.3, 0.05 * (i % 3) - 0.05, 0.07 * (i % 2)), (i / 6, 1 - i / 6, 0.4), 0.08, 0.8) for i in range(7)]


def write_grey(path, side, inside, outside):
    """Writes a mask: one value in its middle, another around it."""
    value = lambda x, y: inside if side // 4 <= x < 3 * side // 4 and side // 4 <= y < 3 * side // 4 else outside
    support.write_png(path, side, side, [[(value(x, y),) * 3 for x in range(side)] for y in range(side)])


def turned_jpeg(data, orientation):
    """Adds an EXIF orientation to the JPEG."""
    exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0" + struct.pack("<HHIHH", 0x112, 3, 1, orientation, 0) + b"\0\0\0\0"
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data[2:]


class Views(support.Case):
    def given(self, *more, views=None, name="given"):
        """Returns the network's input: each picture's bytes."""
        arguments = ["reconstruct", views or self.path("views"), "--model", self.model, "--output", self.path(name + ".ply"), "--center", "0,0,0",
                     "--scale", 1, "--write-views", self.path(name), "--overwrite", *more]
        _, err = self.succeeds(*arguments)
        return [support.read_png(p) for p in sorted(pathlib.Path(self.path(name)).glob("**/*.png"))], err

    def edit(self, change):
        self.edit_views(change)

    def names(self, rename):
        def change(data):
            for frame in data["frames"]:
                frame["file_path"] = rename(frame["file_path"])
        self.edit(change)

    def test_pictures_are_found(self):
        clean, _ = self.given()
        self.assertEqual(len(clean), len({p[2] for p in clean}))
        for rename in (lambda n: n[:-4], lambda n: n.replace(".png", ".jpg"), lambda n: n.upper(), lambda n: "/data/somewhere/" + n,
                       lambda n: "C:\\Users\\somebody\\set\\" + n.replace("/", "\\"), lambda n: "./" + n, lambda n: n.replace("images/", "./pictures/")):
            shutil.copytree(self.path("views"), self.path("kept"))
            self.names(rename)
            self.assertEqual(self.given()[0], clean, rename("images/0.png"))
            os.makedirs(self.path("elsewhere"))
            os.rename(self.path("views", "images"), self.path("elsewhere", "photos"))
            self.refuses(1, ["none of the 3 pictures", "looked for", "--pictures"], *self.reconstruct())
            self.assertEqual(self.given("--pictures", self.path("elsewhere", "photos"))[0], clean, rename("images/0.png"))
            for folder in ("elsewhere", "views"):
                shutil.rmtree(self.path(folder))
            os.rename(self.path("kept"), self.path("views"))
        self.names(lambda n: n.replace(".png", ".jpg"))
        shutil.copy(self.path("views", "images", "1.png"), self.path("views", "images", "1.webp"))
        self.refuses(1, ["1.png", "1.webp", "1.jpg"], *self.reconstruct())

    def test_sets_in_parts(self):
        """In NeRF-synthetic's layout."""
        folder = self.path("lego")
        with open(self.views) as f:
            frames = json.load(f)["frames"]
        self.make_views("more", 8)
        with open(self.path("more", "transforms.json")) as f:
            frames = json.load(f)["frames"]
        parts = {"train": frames[:4], "val": frames[4:5], "test": frames[5:]}
        for part, own in parts.items():
            os.makedirs(os.path.join(folder, part))
            for i, frame in enumerate(own):
                shutil.copy(self.path("more", frame["file_path"]), os.path.join(folder, part, f"r_{i}.png"))
            with open(os.path.join(folder, f"transforms_{part}.json"), "w") as f:
                json.dump({"camera_angle_x": 0.7610127, "frames": [{"file_path": f"./{part}/r_{i}", "transform_matrix": frame["transform_matrix"]}
                                                                for i, frame in enumerate(own)]}, f)
        _, err = self.given("--views", "r_0,r_3", views=folder)
        self.assertIn("transforms_train.json: is read", err)
        out, _ = self.succeeds("dataset", "info", folder, os.path.join(folder, "transforms_test.json"), "--json")
        self.assertEqual([o["views"] for o in json.loads(out)["objects"]], [8, 3])
        # If a set has parts, no compared view was an input: with all test pictures black, the nearest input differs.
        for i in range(3):
            support.write_png(os.path.join(folder, "test", f"r_{i}.png"), self.SIDE, self.SIDE, [[(0, 0, 0)] * self.SIDE] * self.SIDE)
        out, _ = self.succeeds("evaluate", folder, "--model", self.model, "--center", "0,0,0", "--scale", 1, "--json")
        self.assertLess(json.loads(out)["mean"]["psnr_white"], 0.1, "black pictures of the test against white")
        os.remove(os.path.join(folder, "transforms_test.json"))
        os.remove(os.path.join(folder, "transforms_val.json"))
        self.succeeds("evaluate", os.path.join(folder, "transforms_train.json"), "--model", self.model, "--center", "0,0,0", "--scale", 1)

    def test_bad_views_are_left_out(self):
        clean, _ = self.given("--views", "0,2")
        good = pathlib.Path(self.views).read_bytes()
        def matrix(value):
            def change(data):
                data["frames"][1]["transform_matrix"] = value
            return change
        cut = pathlib.Path(self.path("views", "images", "1.png"))
        whole = cut.read_bytes()
        os.makedirs(self.path("views", "m"))
        for i in range(3):
            write_grey(self.path("views", "m", f"{i}.png"), self.SIDE, 255, 255)
        def masks(name):
            def change(data):
                for i, frame in enumerate(data["frames"]):
                    frame["mask_path"] = f"m/{i}.png"
                data["frames"][1]["mask_path"] = name
            return change
        pathlib.Path(self.path("views", "m", "bad.png")).write_bytes(whole[:60])
        for change, word in ((matrix(None), "has no pose"), (matrix([[0] * 4] * 4), "all zeros"), (lambda d: d["frames"][1].update(fl_x=-1), "focal length"),
                             (None, "1.png"), (masks("m/absent.png"), "absent.png"), (masks("m/bad.png"), "bad.png")):
            if change:
                self.edit(change)
            else:
                cut.write_bytes(whole[:len(whole) // 2])
            self.refuses(1, word, *self.reconstruct("--center", "0,0,0", "--scale", 1, "--view-count", 3))
            found, err = self.given("--skip-bad", "--view-count", 3)
            self.assertEqual(found, clean, word)
            self.assertIn("1 of 3", err)
            self.assertIn(word, err)
            self.assertEqual(self.given("--views", "0,2")[0], clean, "what nothing uses is not checked")
            code, _, err = support.run("fit", self.views, "--start", "random", "--steps", 1, "--skip-bad", "--center", "0,0,0", "--scale", 1,
                                       "--output", self.path("fitted.ply"), "--overwrite")
            self.assertEqual(code, 0, err)
            self.assertIn("1 of 3", err)
            cut.write_bytes(whole)
            pathlib.Path(self.views).write_bytes(good)

    def test_bad_cameras_and_pictures_of_a_comparison(self):
        support.write_scene(self.path("scene.ply"), SPLATS)
        self.edit(lambda d: d["frames"][1].update(transform_matrix=None))
        render = ("render", self.path("scene.ply"), "--cameras", self.views)
        self.refuses(1, ["frame 1", "--skip-bad"], *render, "--images", self.path("drawn"))
        _, err = self.succeeds(*render, "--images", self.path("drawn"), "--skip-bad")
        self.assertIn("1 of 3 views", err)
        self.assertEqual(sorted(os.listdir(self.path("drawn"))), ["0000.png", "0001.png"])
        os.remove(self.path("views", "images", "2.png"))
        out, err = self.succeeds(*render, "--compare", self.path("views", "images"), "--skip-bad", "--json")
        comparison = json.loads(out)["comparison"]
        self.assertEqual((len(comparison["pictures"]), comparison["left_out"]), (1, 1))
        self.assertIn("left out of the comparison", err)

    def test_comparisons_read_pictures_as_reconstruct_does(self):
        """Rotated as their EXIF data say; in a folder for each camera; with another ending."""
        support.write_scene(self.path("scene.ply"), SPLATS)
        self.edit(lambda d: d.update(w=16, h=24, cy=12, cx=8))
        self.succeeds("render", self.path("scene.ply"), "--cameras", self.views, "--images", self.path("drawn"), "--format", "jpg", "--quality", 100)
        for i in range(3):
            os.makedirs(self.path("turned", f"cam{i}"))
        self.edit(lambda d: [f.update(file_path=f"cam{i}/1.jpg") for i, f in enumerate(d["frames"])])
        for i in range(3):
            shutil.copy(self.path("drawn", f"{i:04}.jpg"), self.path("turned", f"cam{i}", "1.JPG"))
        render = ("render", self.path("scene.ply"), "--cameras", self.views, "--compare", self.path("turned"), "--json")
        plain = json.loads(self.succeeds(*render)[0])["comparison"]["psnr"]
        self.assertGreater(plain, 30)
        # Drawn and stored on its side, with the tag that displays it upright.
        def on_side(data):
            data.update(w=24, h=16, cx=12, cy=8)
            for frame in data["frames"]:
                m = frame["transform_matrix"]  # the camera rolled by a quarter turn
                for row in m[:3]:
                    row[0], row[1] = -row[1], row[0]
        upright = pathlib.Path(self.views).read_bytes()
        self.edit(on_side)
        self.succeeds("render", self.path("scene.ply"), "--cameras", self.views, "--images", self.path("side"), "--format", "jpg", "--quality", 100)
        pathlib.Path(self.views).write_bytes(upright)
        best = []
        for orientation in (6, 8):
            for i in range(3):
                data = pathlib.Path(self.path("side", f"{i:04}.jpg")).read_bytes()
                pathlib.Path(self.path("turned", f"cam{i}", "1.JPG")).write_bytes(turned_jpeg(data, orientation))
            best.append(json.loads(self.succeeds(*render)[0])["comparison"]["psnr"])
        self.assertGreater(max(best), 30, best)
        self.assertLess(min(best), max(best) - 3, best)

    def masked(self, inside, outside, side=None, count=3):
        os.makedirs(self.path("views", "masks"), exist_ok=True)
        for i in range(count):
            write_grey(self.path("views", "masks", f"{i}.png"), side or self.SIDE, inside, outside)

    def test_masks_beside_the_list(self):
        clean, _ = self.given()
        self.masked(255, 0)
        beside, err = self.given()
        self.assertNotEqual(beside, clean)
        self.assertIn("3 of 3 pictures have a mask in", err)
        self.edit(lambda d: [f.update(mask_path=f"masks/{i}.png") for i, f in enumerate(d["frames"])])
        self.assertEqual(self.given()[0], beside)
        self.masked(255, 0, side=2 * self.SIDE)  # of another size
        larger, _ = self.given()
        for (_, _, a), (_, _, b) in zip(larger, beside):
            self.assertGreater(support.psnr(a, b), 30)
        support.write_png(self.path("views", "masks", "1.png"), 16, 12, [[(255,) * 3] * 16] * 12)
        self.refuses(1, ["masks/1.png is 16 x 12", "shape"], *self.reconstruct("--views", "0,1,2"))
        self.edit(lambda d: [f.pop("mask_path") for f in d["frames"]])
        os.remove(self.path("views", "masks", "1.png"))
        self.refuses(1, ["masks/", "it is the mask of", "2 of 3 pictures have a mask", "--skip-bad"], *self.reconstruct("--views", "0,1,2"))

    def test_masks_that_cannot_be_meant(self):
        self.masked(0, 255)
        _, err = self.given()
        self.assertIn("seem to be inverted", err)
        self.masked(255, 0)
        self.assertNotIn("inverted", self.given()[1])
        for brightest in (0, 1):
            self.masked(brightest, 0)
            self.refuses(1, ["black", "white is the object"], *self.reconstruct("--center", "0,0,0", "--scale", 1))
            self.refuses(1, "black", "fit", self.views, "--start", "random", "--steps", 1, "--output", self.path("fitted.ply"))

    def test_masks_of_data_sets(self):
        for inverted in (False, True):
            self.masked(*((0, 255) if inverted else (255, 0)))
            for command in (("dataset", "info", self.path("views")), ("evaluate", self.path("views"), "--model", self.model)):
                code, _, err = support.run(*command)
                self.assertEqual("seem to be inverted" in err, inverted, err)

    def test_masks_of_target_cameras(self):
        """Drawing needs no pictures; a comparison uses the same pictures as reconstruct, from any working directory."""
        support.write_scene(self.path("scene.ply"), SPLATS)
        render = ("render", self.path("scene.ply"), "--cameras", self.views, "--images", self.path("drawn"), "--overwrite")
        compare = (*render, "--compare", self.path("views", "images"), "--json")
        without = json.loads(self.succeeds(*compare)[0])["comparison"]["psnr"]
        self.masked(255, 0)
        beside = json.loads(self.succeeds(*compare)[0])["comparison"]["psnr"]
        self.assertNotEqual(beside, without)
        self.edit(lambda d: [f.update(mask_path=f"masks/{i}.png") for i, f in enumerate(d["frames"])])
        self.succeeds(*render)
        self.assertEqual(json.loads(self.succeeds(*compare)[0])["comparison"]["psnr"], beside)
        os.remove(self.path("views", "masks", "1.png"))
        self.succeeds(*render)
        self.refuses(1, "masks/1.png", *compare)

    def test_views_with_one_pose(self):
        def change(data):
            for frame in data["frames"]:
                frame["transform_matrix"] = data["frames"][0]["transform_matrix"]
        self.assertNotIn("the same pose", self.given()[1])
        self.edit(change)
        self.assertIn("views have nearly the same pose", self.given("--view-count", 3)[1])

    def test_what_is_no_list_is_named(self):
        picture = self.path("views", "images", "0.png")
        self.refuses(1, ["a PNG picture", "vsplat poses "], "reconstruct", picture, "--output", self.path("out.ply"))
        shutil.copy(picture, self.path("views", "0.png"))
        self.refuses(1, ["a PNG picture", "--views"], "reconstruct", self.path("views", "0.png"), "--output", self.path("out.ply"))
        pictures = self.path("views", "images")
        self.refuses(1, ["3 pictures", f"\n  vsplat poses {pictures} --output images-posed\n", "--mask-command"], "reconstruct", pictures, "--output",
                     self.path("out.ply"))

    def test_cameras_from_a_pipe(self):
        support.write_scene(self.path("scene.ply"), SPLATS)
        render = [support.VSPLAT, "render", self.path("scene.ply"), "--cameras"]
        self.succeeds(*render[1:], self.views, "--images", self.path("file"))
        with open(self.views, "rb") as f:
            done = subprocess.run([*render, "-", "--images", self.path("pipe")], input=f.read(), capture_output=True, timeout=support.PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        for i in range(3):
            self.assertEqual(support.read_png(self.path("pipe", f"{i:04}.png")), support.read_png(self.path("file", f"{i:04}.png")))
        # Its pictures are in the folder that contains it.
        text = pathlib.Path(self.views).read_bytes()
        self.given()
        reconstruct = [support.VSPLAT, "reconstruct", "-", "--model", self.model, "--center", "0,0,0", "--scale", "1", "--output"]
        done = subprocess.run([*reconstruct, self.path("piped.ply")], input=text, capture_output=True, timeout=support.PATIENCE, cwd=self.path("views"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(*(pathlib.Path(self.path(name)).read_bytes() for name in ("piped.ply", "given.ply")))
        done = subprocess.run([*reconstruct, self.path("no.ply")], input=text, capture_output=True, timeout=support.PATIENCE, cwd=self.folder)
        self.assertEqual(done.returncode, 1)
        self.assertIn(b"looked for images/0.png in .", done.stderr)
        self.refuses(1, ["a file", "standard input"], "render", "-", "--cameras", self.views, "--images", self.path("no"))

    def test_points_that_a_list_names(self):
        self.edit(lambda d: d.update(ply_file_path="points.ply", aabb_center=[0, 0, 0], aabb_half=0.5))
        with open(self.path("views", "points.ply"), "w") as f:
            f.write("ply\nformat ascii 1.0\nelement vertex 40\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                    "property uchar green\nproperty uchar blue\nend_header\n" + "".join(f"{0.01 * i} {0.2 - 0.01 * i} 0.1 {i} 99 200\n" for i in range(40)))
        _, err = self.succeeds("fit", self.views, "--start", "points", "--steps", 1, "--output", self.path("fitted.ply"))
        self.assertIn("40 of the 40 points", err)


if __name__ == "__main__":
    support.main()
