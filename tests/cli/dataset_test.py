"""vsplat dataset: data sets from meshes and from random solids."""
import json
import os
import pathlib

import support

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


class Dataset(support.FolderCase):
    def mesh(self, *parts, text=OBJ):
        os.makedirs(os.path.dirname(self.path(*parts)), exist_ok=True)
        pathlib.Path(self.path(*parts)).write_text(text)
        return self.path(*parts)

    def render(self, *more):
        return ("dataset", "render", *more, "--output", self.path("set"), "--views", 3, "--size", 16)

    def test_a_folder_for_each_mesh(self):
        meshes = [self.mesh("a", "model.obj"), self.mesh("b", "model.obj"), self.mesh("c.obj")]
        out, _ = self.succeeds(*self.render(*meshes, "--json"))
        result = json.loads(out)
        self.assertEqual([o["name"] for o in result["objects"]], ["a", "b", "c"])
        self.assertEqual([o["triangles"] for o in result["objects"]], [4] * 3)
        for name in "abc":
            self.assertEqual(sorted(os.listdir(self.path("set", name))), ["images", "transforms.json"])
            self.assertEqual(sorted(os.listdir(self.path("set", name, "images"))), ["0000.png", "0001.png", "0002.png"])
            views = json.loads(pathlib.Path(self.path("set", name, "transforms.json")).read_text())
            self.assertEqual((views["aabb_center"], views["aabb_half"], len(views["frames"])), ([0, 0, 0], 0.5, 3))
            with open(self.path("set", name, "images", "0000.png"), "rb") as f:
                self.assertEqual(f.read(26)[16:26], bytes([0, 0, 0, 16, 0, 0, 0, 16, 8, 6]))    # 16 x 16, 8 bits, RGBA

    def test_what_is_procedural_depends_on_the_seed_alone(self):
        os.makedirs(self.path("pictures"))
        support.write_png(self.path("pictures", "paint.png"), 1, 1, [[(250, 0, 0)]])
        for more, name in (("--solids", "solid_0001"), ((), "object_0001"), (("--textures", self.path("pictures")), "object_0001")):
            with self.subTest(more):
                self.depends_on_the_seed_alone(name, (more,) if isinstance(more, str) else more)

    def depends_on_the_seed_alone(self, name, more):
        def made(folder, seed):
            self.succeeds("dataset", "procedural", "--count", 2, "--output", self.path(folder), "--views", 2, "--size", 24, "--seed", seed, *more,
                          "--overwrite")
            return {name.replace(self.path(folder), ""): data for name, data in self.snapshot().items() if name.startswith(self.path(folder))}
        first = made("one", 5)
        self.assertEqual(first, made("two", 5))
        self.assertNotEqual(first, made("three", 6))
        self.assertIn(f"/{name}/transforms.json", first)
        for folder in ("one", "two", "three"):
            support.shutil.rmtree(self.path(folder))

    def test_nothing_is_replaced_unasked(self):
        mesh = self.mesh("c.obj")
        self.succeeds(*self.render(mesh))
        self.refuses(1, ["exists", "--overwrite"], *self.render(mesh))
        self.succeeds(*self.render(mesh, "--overwrite"))

    def test_bad_meshes_are_named(self):
        for text, word in [("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "bad.obj"), (OBJ.replace("v 1", "v nan"), "finite"),
                           ("mtllib gone.mtl\nusemtl m\n" + OBJ, "gone.mtl")]:
            self.refuses(1, ["bad.obj", word], *self.render(self.mesh("bad.obj", text=text)))
        self.refuses(1, "none.obj", *self.render(self.path("none.obj")))
        mesh = self.mesh("c.obj")
        support.write_png(self.path("paint.png"), 1, 1, [[(9, 9, 9)]])
        self.refuses(1, ["c.obj", "texture coordinates"], *self.render(mesh, "--texture", self.path("paint.png")))
        self.refuses(1, "gone.png", *self.render(mesh, "--texture", self.path("gone.png")))

    def test_finished_objects_stay(self):
        _, _, err = support.run(*self.render(self.mesh("c.obj"), self.path("none.obj")))
        self.assertIn("1 of 2 objects", err)
        self.assertEqual(os.listdir(self.path("set")), ["c"])

    def info(self, *more, code=0):
        got, out, err = support.run("dataset", "info", *more, "--json")
        self.assertEqual(got, code, err)
        return json.loads(out), err

    def test_info_tells_what_a_set_holds(self):
        self.succeeds(*self.render(self.mesh("cup.obj"), self.mesh("dish.obj")))
        result, _ = self.info(self.path("set"), "--sheet", self.path("sheet.png"))
        self.assertEqual((result["views"], result["bad"], [o["name"] for o in result["objects"]]), (6, 0, ["cup", "dish"]))
        cup = result["objects"][0]
        self.assertEqual((cup["layout"], cup["path"], cup["views"], cup["pictures"], cup["bad"]), ("folder", self.path("set", "cup"), 3, 3, []))
        self.assertEqual((cup["width"], cup["height"], cup["center"], cup["scale"]), ([16, 16], [16, 16], [0, 0, 0], 1))
        for angle in cup["fov"]:
            self.assertAlmostEqual(angle, 49.1, 1)
        self.assertTrue(2.1 <= cup["distance"][0] < cup["distance"][1] <= 2.5, cup["distance"])   # farther away, so that it fits
        self.assertTrue(0.02 < cup["alpha"] < 0.5, cup["alpha"])
        width, height, pixels = support.read_png(self.path("sheet.png"))
        self.assertEqual((width, height), (6 * 24 + 8, 24 + 12 + 8))  # 3 of 16 pixels for each object, 8 between them, names below
        self.assertGreater(len({pixels[3 * (width * 16 + x)] for x in range(8, 24)}), 1, "a picture is on it")
        table, _ = self.succeeds("dataset", "info", self.path("set"))
        self.assertEqual(table.splitlines()[-1], self.path("set") + ": 2 objects, 6 views")
        self.refuses(1, ["sheet.png", "--overwrite"], "dataset", "info", self.path("set"), "--sheet", self.path("sheet.png"))

    def test_info_tells_what_is_bad(self):
        self.succeeds("dataset", "render", self.mesh("cup.obj"), self.mesh("dish.obj"), "--output", self.path("set"), "--views", 9, "--size", 16)
        os.remove(self.path("set", "cup", "images", "0004.png"))
        pathlib.Path(self.path("set", "cup", "images", "0001.png")).write_bytes(b"no picture")
        pathlib.Path(self.path("set", "dish", "transforms.json")).write_text("{")
        result, err = self.info(self.path("set"), "--check", "--sheet", self.path("sheet.png"), code=1)
        self.assertEqual((result["views"], result["bad"]), (7, 3))
        self.assertIn("0001.png", result["objects"][0]["bad"][0])
        self.assertIn("0004.png", result["objects"][0]["bad"][1])
        self.assertIn("object dish", result["objects"][1]["bad"][0])
        for words in ("object cup: view 4", "object dish", self.path("set") + ": 3 bad"):
            self.assertIn(words, err)
        self.assertTrue(os.path.exists(self.path("sheet.png")))

    def test_each_missing_picture_is_reported(self):
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("set"), "--views", 8, "--size", 16, "--seed", 3)
        for name in ("0002.png", "0005.png"):
            os.remove(self.path("set", "solid_0000", "images", name))
        _, _, err = support.run("dataset", "info", self.path("set"))
        first, second = [line for line in err.splitlines() if line.startswith("bad: ")]
        self.assertTrue("0002.png" in first and "0005.png" not in first, first)
        self.assertTrue("0005.png" in second and "0002.png" not in second, second)

    def test_info_of_views_with_one_pose(self):
        self.succeeds(*self.render(self.mesh("cup.obj")))
        self.assertNotIn("pose", self.info(self.path("set"))[1])
        path = pathlib.Path(self.path("set", "cup", "transforms.json"))
        listed = json.loads(path.read_text())
        for frame in listed["frames"]:
            frame["transform_matrix"] = listed["frames"][0]["transform_matrix"]
        path.write_text(json.dumps(listed))
        self.assertIn("cup: all 3 views have nearly the same pose", self.info(self.path("set"))[1])

    def test_info_of_what_is_no_set(self):
        self.refuses(1, "nowhere", "dataset", "info", self.path("nowhere"))
        os.makedirs(self.path("hollow"))
        self.refuses(1, ["hollow", "no object"], "dataset", "info", self.path("hollow"))
        self.refuses(2, [".png"], "dataset", "info", self.path("hollow"), "--sheet", self.path("a.jpg"))
        self.refuses(2, "data", "dataset", "info")

    def test_wrong_requests(self):
        self.refuses(2, "--count", "dataset", "procedural", "--output", self.path("set"))
        procedural = ("dataset", "procedural", "--count", 1, "--views", 1, "--size", 8, "--output", self.path("set"))
        self.refuses(1, "nowhere", *procedural, "--textures", self.path("nowhere"))
        self.refuses(2, ["--solids", "--textures"], *procedural, "--solids", "--textures", self.folder)
        self.refuses(2, "--size", *self.render(self.mesh("c.obj"))[:-1], 4)
        self.refuses(2, "meshes", "dataset", "render", "--output", self.path("set"))


if __name__ == "__main__":
    support.main()
