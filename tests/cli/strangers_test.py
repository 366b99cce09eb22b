"""Untrusted files: files that they name are read only below their folder, invalid content gives an error that names file and field, and
nothing in them affects a terminal."""
import json
import os
import pathlib
import shutil
import struct
import subprocess

import support


class Outside(support.Case):
    """Pictures and masks of a list of cameras, in a folder beside it."""
    def setUp(self):
        super().setUp()
        os.makedirs(self.path("elsewhere"))
        shutil.copy(self.path("views", "images", "0.png"), self.path("elsewhere", "0.png"))

    def first(self, **fields):
        self.edit_views(lambda data: data["frames"][0].update(fields))

    def refused(self, *words):
        self.refuses(1, ["transforms.json: frame 0", "outside", "--allow-outside", *words], *self.reconstruct())
        self.succeeds(*self.reconstruct("--allow-outside", "--overwrite"))
        os.remove(self.path("out.ply"))

    def test_pictures(self):
        os.remove(self.path("views", "images", "0.png"))  # it would be found instead: it has the name, and is inside the folder
        for name in ("../elsewhere/0.png", self.path("elsewhere", "0.png"), "images/../../elsewhere/0.png"):
            self.first(file_path=name)
            self.refused("its picture", "elsewhere/0.png")

    def test_links(self):
        os.remove(self.path("views", "images", "0.png"))
        os.symlink(self.path("elsewhere", "0.png"), self.path("views", "images", "0.png"))
        self.refused("its picture", "images/0.png")
        os.remove(self.path("views", "images", "0.png"))
        os.symlink("1.png", self.path("views", "images", "0.png"))
        self.succeeds(*self.reconstruct())

    def test_masks(self):
        self.first(mask_path="../elsewhere/0.png")
        self.refused("its mask", "elsewhere/0.png")
        self.first(mask_path="/dev/zero")
        self.refuses(1, ["its mask", "/dev/zero", "outside"], *self.reconstruct())
        self.refuses(1, ["/dev/zero"], *self.reconstruct("--allow-outside"))
        os.mkfifo(self.path("views", "pipe.png"))
        self.first(mask_path="pipe.png")
        self.refuses(1, ["pipe.png"], *self.reconstruct())

    def test_folders_that_are_given(self):
        """A data set's folder, and a COLMAP model's pictures."""
        os.makedirs(self.path("set", "shared"))
        shutil.copytree(self.path("views"), self.path("set", "object"))
        shutil.copy(self.path("elsewhere", "0.png"), self.path("set", "shared", "0.png"))
        self.views = self.path("set", "object", "transforms.json")
        self.first(file_path="../shared/0.png")
        os.remove(self.path("set", "object", "images", "0.png"))
        self.succeeds("dataset", "info", self.path("set"))
        code, out, _ = support.run("dataset", "info", self.path("set", "object"), "--json")
        self.assertEqual(code, 1)
        self.assertIn("outside", out)
        self.succeeds("dataset", "info", self.path("set", "object"), "--allow-outside")
        # Target cameras need no picture.
        support.write_scene(self.path("s.ply"), [((0, 0, 0), (1, 0, 0), 0.1, 0.9)])
        self.succeeds("render", self.path("s.ply"), "--cameras", self.views, "--images", self.path("x"))
        os.makedirs(self.path("given"))
        for i in range(3):
            os.symlink(self.path("views", "images", f"{i}.png"), self.path("given", f"{i}.png"))
        self.refuses(1, ["given", "outside", "--allow-outside"], "render", self.path("s.ply"), "--cameras", self.views, "--compare", self.path("given"))

    def test_what_a_user_names_may_be_a_link(self):
        os.symlink(self.views, self.path("link.json"))
        os.symlink(self.path("views"), self.path("link"))
        os.symlink(self.model, self.path("link.safetensors"))
        self.views = self.path("link")
        self.model = self.path("link.safetensors")
        self.succeeds(*self.reconstruct())


class Meshes(support.FolderCase):
    def setUp(self):
        super().setUp()
        os.makedirs(self.path("mesh"))
        support.write_png(self.path("t.png"), 1, 1, [[(9, 9, 9)]])
        self.put("m.mtl", "newmtl m\nKd 1 0 0\n")

    def put(self, name, text):
        pathlib.Path(self.path(*name.split("/"))).write_text(text)
        return self.path(*name.split("/"))

    def obj(self, head):
        corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n"
        return self.put("mesh/a.obj", head + corners + "f 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n")

    def render(self, mesh, *more):
        return ("dataset", "render", mesh, "--output", self.path("set"), "--views", 1, "--size", 16, *more)

    def refused(self, mesh, *words):
        self.refuses(1, [mesh, "outside", "--allow-outside", *words], *self.render(mesh))
        self.succeeds(*self.render(mesh, "--allow-outside"))
        shutil.rmtree(self.path("set"))

    def test_materials_and_textures(self):
        self.refused(self.obj("mtllib ../m.mtl\n"), "m.mtl")
        self.put("mesh/m.mtl", "newmtl m\nmap_Kd ../t.png\n")
        self.refused(self.obj("mtllib m.mtl\n"), "its texture", "t.png")
        os.symlink(self.path("t.png"), self.path("mesh", "t.png"))
        self.put("mesh/m.mtl", "newmtl m\nmap_Kd t.png\n")
        self.refused(self.obj("mtllib m.mtl\n"), "its texture", "t.png")
        os.remove(self.path("mesh", "t.png"))
        shutil.copy(self.path("t.png"), self.path("mesh", "t.png"))
        self.succeeds(*self.render(self.obj("mtllib m.mtl\n")))

    def test_names_in_either_unicode_form(self):
        for at, (there, listed) in enumerate((("e\u0301", "\u00e9"), ("\u00e9", "e\u0301"))):
            shutil.copy(self.path("t.png"), self.path("mesh", f"{there}{at}.png"))
            self.put(f"mesh/{there}{at}.mtl", f"newmtl m\nmap_Kd {listed}{at}.png\n")
            _, err = self.succeeds(*self.render(self.obj(f"mtllib {listed}{at}.mtl\n"), "--overwrite"))
            self.assertNotIn("warning", err)
            pathlib.Path(self.path("mesh", f"{there}{at}.bin")).write_bytes(struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0))
            gltf = self.put("mesh/a.gltf", json.dumps(self.triangle(f"{listed}{at}.bin")))
            self.succeeds(*self.render(gltf, "--overwrite"))

    def test_what_is_no_file(self):
        os.mkfifo(self.path("mesh", "pipe"))
        self.refuses(1, ["a.obj", "pipe"], *self.render(self.obj("mtllib pipe\n")))
        self.put("mesh/m.mtl", "newmtl m\nmap_Kd pipe\n")
        self.refuses(1, ["pipe", "regular file"], *self.render(self.obj("mtllib m.mtl\n")))
        zero = os.path.relpath("/dev/zero", os.path.realpath(self.path("mesh")))
        self.refuses(1, ["dev/zero", "outside"], *self.render(self.obj(f"mtllib {zero}\n")))

    def triangle(self, uri):
        return {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "scene": 0, "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
                "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"uri": uri, "byteLength": 36}]}

    def test_buffers(self):
        pathlib.Path(self.path("b.bin")).write_bytes(struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0))
        self.refused(self.put("mesh/a.gltf", json.dumps(self.triangle("../b.bin"))), "b.bin")


class Words(support.Case):
    def header(self, change):
        """Rewrites the model's header."""
        data = pathlib.Path(self.model).read_bytes()
        size = struct.unpack("<Q", data[:8])[0]
        header, body = json.loads(data[8:8 + size]), bytearray(data[8 + size:])
        header["__metadata__"].pop("sha256", None)
        change(header, body)
        text = json.dumps(header).encode()
        open(self.model, "wb").write(struct.pack("<Q", len(text)) + text + body)

    def test_json_that_is_no_configuration(self):
        for text, words in (('{"model": ' + "[" * 100000 + "]" * 100000 + "}", "nested deeper"), ('{"steps": 3, "steps": 4}', "steps twice"),
                            ('{"model": {"base": "micro", "base": "tiny"}}', "base twice")):
            pathlib.Path(self.path("c.json")).write_text(text)
            self.refuses(1, [self.path("c.json"), words], "train", self.path("c.json"), "--print-config")
        os.mkfifo(self.path("pipe"))
        self.refuses(1, ["pipe", "regular file"], "train", self.path("pipe"), "--print-config")
        self.edit_views(lambda data: data)
        text = open(self.views).read()
        open(self.views, "w").write('{"fl_x": 1, ' + text[1:])
        self.refuses(1, ["transforms.json", "fl_x twice"], *self.reconstruct())
        self.header(lambda header, body: header["__metadata__"].update(config="[" * 100000 + "]" * 100000))
        for command in ("info", "verify"):
            self.refuses(1, ["model.safetensors", "nested deeper"], "weights", command, self.model)

    def test_models_of_no_numbers(self):
        def spoil(header, body):
            entry = header["head.coarse.3.weight"] if "head.coarse.3.weight" in header else header[sorted(k for k in header if k != "__metadata__")[0]]
            at = entry["data_offsets"][0]
            body[at:at + 4] = struct.pack("<f", float("nan"))
        self.header(spoil)
        for command in (("weights", "verify", self.model), self.reconstruct(), ("evaluate", self.path("views"), "--model", self.model)):
            self.refuses(1, ["model.safetensors", "NaN at element 0", "finite"], *command)

    def test_nothing_acts_on_a_terminal(self):
        self.header(lambda header, body: header["__metadata__"].update({"origin\x1b[2J": "\x1b]0;owned\x07\x9b2J"}))
        evil = "\x1b]0;owned\x07a.png"
        os.rename(self.path("views", "images", "0.png"), self.path("views", "images", evil))
        self.edit_views(lambda data: data["frames"][0].update(file_path="images/" + evil))
        for command in (("weights", "info", self.model), ("weights", "verify", self.model), self.reconstruct("--verbose"),
                        ("dataset", "info", self.path("views")), self.reconstruct("--views", "\x1b[2J"), ("render", "\x1b[2J", "--cameras", "orbit:1")):
            _, out, err = support.run(*command)
            for text in (out, err):
                self.assertFalse([c for c in text if ord(c) < 32 and c not in "\n\t" or 0x7f <= ord(c) < 0xa0], text)
        os.remove(self.path("views", "images", evil))
        self.assertNotIn("\x1b", support.run(*self.reconstruct("--overwrite"))[2])

    def test_a_path_that_is_no_utf8(self):
        path = os.fsencode(self.path("out-")) + b"\xff.ply"
        command = ["reconstruct", self.views, "--model", self.model, "--json", "--output"]
        done = subprocess.run([support.VSPLAT, *command, path], capture_output=True, timeout=200)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("gaussians", json.loads(done.stdout))
        self.assertTrue(os.path.exists(path))


if __name__ == "__main__":
    support.main()
