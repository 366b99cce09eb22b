"""vsplat dataset: sets of pictures from meshes and from random solids."""
import json
import os
import unittest

import support

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


class Dataset(support.Case):
    def setUp(self):
        self.folder = support.tempfile.mkdtemp(prefix="vsplat-cli-")
        self.addCleanup(support.shutil.rmtree, self.folder, True)

    def mesh(self, *parts, text=OBJ):
        os.makedirs(os.path.dirname(self.path(*parts)), exist_ok=True)
        with open(self.path(*parts), "w") as f:
            f.write(text)
        return self.path(*parts)

    def render(self, *more):
        return ("dataset", "render", *more, "--output", self.path("set"), "--views", 3, "--size", 16)

    def test_a_folder_for_each_mesh(self):
        meshes = [self.mesh("a", "model.obj"), self.mesh("b", "model.obj"), self.mesh("c.obj")]
        out, _ = self.succeeds(*self.render(*meshes, "--json"))
        told = json.loads(out)
        self.assertEqual([o["name"] for o in told["objects"]], ["a", "b", "c"])
        self.assertEqual([o["triangles"] for o in told["objects"]], [4] * 3)
        for name in "abc":
            self.assertEqual(sorted(os.listdir(self.path("set", name))), ["images", "transforms.json"])
            self.assertEqual(sorted(os.listdir(self.path("set", name, "images"))), ["0000.png", "0001.png", "0002.png"])
            with open(self.path("set", name, "transforms.json")) as f:
                views = json.load(f)
            self.assertEqual((views["aabb_center"], views["aabb_half"], len(views["frames"])), ([0, 0, 0], 0.5, 3))
            with open(self.path("set", name, "images", "0000.png"), "rb") as f:
                self.assertEqual(f.read(26)[16:26], bytes([0, 0, 0, 16, 0, 0, 0, 16, 8, 6]))    # 16 x 16, 8 bits, RGBA

    def test_solids_depend_on_the_seed_alone(self):
        def made(folder, seed):
            self.succeeds("dataset", "procedural", "--count", 2, "--output", self.path(folder), "--views", 2, "--size", 24, "--seed", seed)
            return {name.replace(self.path(folder), ""): data for name, data in self.snapshot().items() if name.startswith(self.path(folder))}
        first = made("one", 5)
        self.assertEqual(first, made("two", 5))
        self.assertNotEqual(first, made("three", 6))
        self.assertIn("/solid_0001/transforms.json", first)

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

    def test_wrong_requests(self):
        self.refuses(2, "--count", "dataset", "procedural", "--output", self.path("set"))
        self.refuses(2, "--size", *self.render(self.mesh("c.obj"))[:-1], 4)
        self.refuses(2, "meshes", "dataset", "render", "--output", self.path("set"))


if __name__ == "__main__":
    support.main()
