"""Well-formed requests that cannot be served: exit code 1, a specific message, nothing written."""
import json
import os
import pathlib
import random
import struct
import subprocess
import unittest

import support

POCL = "/etc/OpenCL/vendors/pocl.icd"


class Outputs(support.Case):
    def test_nothing_is_written_where_one_file_exists(self):
        more = ["--render", "orbit:2", "--images", self.path("pictures"), "--write-views", self.path("seen"), "--write-selection",
                self.path("voxels.txt"), "--dump", self.path("dump"), "--profile", self.path("p.json"), "--trace", self.path("t.json")]
        for name in ("out.ply", "pictures/0001.png", "seen/cameras.json", "seen/2.png", "voxels.txt", "dump/stages.safetensors", "p.json", "t.json"):
            with self.subTest(name=name):
                os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
                open(self.path(name), "w").write("mine")
                self.refuses(1, [os.path.basename(name), "--overwrite"], *self.reconstruct(*more, "--views", "0,1,2"))
                os.remove(self.path(name))
        open(self.path("out.ply"), "w").write("mine")
        self.succeeds(*self.reconstruct(*more, "--overwrite"))
        self.assertTrue(pathlib.Path(self.path("out.ply")).read_bytes().startswith(b"ply\n"))

    def test_folder_that_cannot_be_written(self):
        open(self.path("file"), "w").write("")
        self.refuses(1, "not a folder", *self.reconstruct("--profile", self.path("file", "p.json")))
        self.refuses(1, "cannot be written", *self.reconstruct("--profile", "/proc/no/p.json"))
        os.makedirs(self.path("profiles"))
        self.refuses(1, "not a file", *self.reconstruct("--profile", self.path("profiles")))
        self.refuses(1, "/proc", "init", "micro", "--seed", 1, "--output", "/proc/model.safetensors")

    def test_unknown_device_and_no_platform(self):
        self.refuses(1, ["no device", "quantum"], *self.reconstruct("--device", "quantum"))
        self.refuses(1, "no device", *self.reconstruct(), env={"VSPLAT_DEVICE": "quantum"})
        # Two devices with the same name, because PoCL is configured to have two.
        two = {"POCL_DEVICES": "pthread basic", "VSPLAT_DEVICE": ""}
        self.refuses(1, ["part of the names of 2 devices", "0:0", "0:1"], *self.reconstruct("--device", "portable"), env=two)
        self.refuses(1, ["no OpenCL device", "pocl-opencl-icd"], *self.reconstruct(), env={"OCL_ICD_VENDORS": self.path("none")})
        self.refuses(1, ["no OpenCL device", "found no platform", "pocl-opencl-icd"], "devices", env={"OCL_ICD_VENDORS": self.path("none")})
        code, out, err = support.run("devices", "--json", env={"OCL_ICD_VENDORS": self.path("none")})
        self.assertEqual((code, json.loads(out)), (1, []))
        self.assertIn("no OpenCL device", err)

    @unittest.skipUnless(os.path.exists(POCL), "PoCL is not there")
    def test_a_driver_whose_cache_cannot_be_written(self):
        """As in a container or a service whose HOME belongs to another user."""
        for variables, folder in (({"POCL_CACHE_DIR": "/proc/none"}, "/proc/none"),
                                  ({"POCL_CACHE_DIR": None, "XDG_CACHE_HOME": "/proc/none"}, "/proc/none/pocl/kcache"),
                                  ({"POCL_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": "/proc/none"}, "/proc/none/.cache/pocl/kcache")):
            unset = [f"--unset={name}" for name, value in variables.items() if value is None]
            settings = [f"{name}={value}" for name, value in {"OCL_ICD_VENDORS": POCL, **variables}.items() if value is not None]
            for command in (["devices"], self.reconstruct()):
                with self.subTest(folder=folder, command=command[0]):
                    done = subprocess.run(["env", *unset, *settings, support.VSPLAT, *command], capture_output=True, text=True, timeout=support.PATIENCE)
                    self.assertEqual((done.returncode, done.stdout), (1, ""), done.stderr)
                    for word in ("Portable Computing Language", folder + ",", "POCL_CACHE_DIR", "XDG_CACHE_HOME"):
                        self.assertIn(word, done.stderr)
                    self.assertNotIn("pocl-opencl-icd", done.stderr)     # it is installed

    def test_more_memory_than_there_is(self):
        self.refuses(1, ["memory", "0.0005 GiB"], *self.reconstruct("--max-memory", "0.0005"))
        self.refuses(1, ["memory", "picture"], *self.reconstruct("--render", "orbit:1", "--images", self.path("x"), "--size", "16384x16384",
                                                                 "--max-memory", "0.5"))
        self.succeeds(*self.reconstruct("--max-memory", "1e300"))           # accepted, up to the number of existing bytes


class Views(support.Case):
    def test_no_such_file(self):
        self.refuses(1, "nowhere", "reconstruct", self.path("nowhere"), "--model", self.model, "--output", self.path("x.ply"))

    def test_not_a_list_of_views(self):
        for text in ("", "{", "[]", "3", "{}", '{"frames": 1}', '{"frames": [1]}', "[" * 100000, "[{}]"):
            open(self.views, "w").write(text)
            self.refuses(1, "transforms.json", *self.reconstruct())
        open(self.views, "wb").write(b'["\xc8\xff')
        self.assertNotIn("\\x", self.refuses(1, "transforms.json: is not valid JSON", *self.reconstruct()))
        self.refuses(1, "images", "reconstruct", self.path("views", "images"), "--model", self.model, "--output", self.path("x.ply"))

    def test_truncated_picture(self):
        path = self.path("views", "images", "1.png")
        data = pathlib.Path(path).read_bytes()
        open(path, "wb").write(data[:len(data) // 2])
        self.refuses(1, "1.png", *self.reconstruct("--views", "0,1"))

    def test_pictures_that_are_missing(self):
        os.remove(self.path("views", "images", "1.png"))
        self.refuses(2, "1", *self.reconstruct("--views", "0,1"))
        _, err = self.succeeds(*self.reconstruct())
        self.assertEqual(err.count("warning"), 1)
        for i in (0, 2):
            os.remove(self.path("views", "images", f"{i}.png"))
        self.refuses(1, "transforms.json", *self.reconstruct("--overwrite"))

    def test_poses(self):
        def set_pose(value):
            def change(data):
                data["frames"][1]["transform_matrix"] = value
            return change
        good = support.camera_to_world(30)
        for words, pose in ((["transform_matrix"], [[0] * 4] * 4), (["transform_matrix", "finite"], [[float("nan")] * 4, *good[1:]]),
                            (["transform_matrix"], good[:3] + [[0, 0, 0]]), (["transform_matrix"], "identity")):
            self.edit_views(set_pose(pose))
            self.refuses(1, words + ["transforms.json"], *self.reconstruct())

    def test_picture_and_intrinsics_disagree(self):
        self.edit_views(lambda data: data.update(w=32))
        self.refuses(1, ["32", "16"], *self.reconstruct())

    def test_cube_that_is_not_in_view(self):
        self.refuses(1, "behind", *self.reconstruct("--center", "0,0,50"))
        self.refuses(1, "cube", *self.reconstruct("--scale", "5"))                         # a corner is behind a camera
        self.refuses(1, "cube", *self.reconstruct("--scale", "5", "--force"))              # --force does not allow that
        self.refuses(1, ["w2c"], *self.swapped(), "--center", "0,0,0", "--scale", 1)
        self.refuses(1, ["w2c", "do not meet in front of them"], "reconstruct", self.path("swapped"), "--view-count", 3, "--model", self.model, "--output", self.path("x.ply"))

    def swapped(self):
        """OpenGL camera-to-world matrices in our cameras.json, which has OpenCV world-to-camera ones."""
        os.makedirs(self.path("swapped"))
        cameras = []
        for i in range(3):
            os.link(self.path("views", "images", f"{i}.png"), self.path("swapped", f"{i}.png"))
            cameras.append({"file": f"{i}.png", "w": 16, "h": 16, "fx": 20, "fy": 20, "cx": 8, "cy": 8,
                            "w2c": support.camera_to_world(100 * i + 10)})
        json.dump(cameras, open(self.path("swapped", "cameras.json"), "w"))
        return "reconstruct", self.path("swapped"), "--model", self.model, "--output", self.path("x.ply")


class Models(support.Case):
    def header(self, data):
        size = struct.unpack("<Q", data[:8])[0]
        return json.loads(data[8:8 + size]), data[8 + size:]

    def write(self, header, body):
        text = json.dumps(header).encode()
        open(self.model, "wb").write(struct.pack("<Q", len(text)) + text + body)

    def test_damage_is_found(self):
        data = pathlib.Path(self.model).read_bytes()
        rng = random.Random(1)
        for _ in range(8):
            open(self.model, "wb").write(data[:rng.randrange(len(data))])
            self.refuses(1, "model.safetensors", *self.reconstruct())
            self.refuses(1, "model.safetensors", "weights", "verify", self.model)
        for _ in range(8):
            broken = bytearray(data)
            broken[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            open(self.model, "wb").write(broken)
            self.refuses(1, "model.safetensors", *self.reconstruct())

    def test_tensors_that_do_not_fit(self):
        header, body = self.header(pathlib.Path(self.model).read_bytes())
        name = next(n for n in header if n.endswith("attn.qkv.weight"))
        del header["__metadata__"]["sha256"]
        original = header[name]
        header[name] = {**original, "shape": original["shape"][::-1]}
        self.write(header, body)
        self.refuses(1, [name, "shape"], *self.reconstruct())
        header["another"] = header.pop(name)
        header["another"]["shape"] = original["shape"]
        self.write(header, body)
        self.refuses(1, name, *self.reconstruct())

    def test_not_a_model(self):
        self.refuses(1, "nowhere", "weights", "info", self.path("nowhere"))
        open(self.model, "w").write("not a model")
        self.refuses(1, "model.safetensors", "weights", "info", self.model)


class Scenes(support.Case):
    def test_damaged_ply(self):
        self.succeeds(*self.reconstruct())
        data = pathlib.Path(self.path("out.ply")).read_bytes()
        open(self.path("out.ply"), "wb").write(data[:-10])
        self.refuses(1, "out.ply", "render", self.path("out.ply"), "--cameras", "orbit:1", "--images", self.path("x"))
        self.refuses(1, "none.ply", "render", self.path("none.ply"), "--cameras", "orbit:1", "--images", self.path("x"))

    def write_scene(self, *rows, count=None, name="scene.ply"):
        """Writes Gaussians as text. Returns the number of bytes of the header."""
        names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
        head = (f"ply\nformat ascii 1.0\nelement vertex {len(rows) if count is None else count}\n"
                + "".join(f"property float {n}\n" for n in names) + "end_header\n")
        pathlib.Path(self.path(name)).write_text(head + "".join(row + "\n" for row in rows))
        return len(head)

    def render(self, *more):
        return ("render", self.path("scene.ply"), "--cameras", "orbit:1", "--images", self.path("x"), "--size", "16x16", *more)

    def test_single_bad_gaussians(self):
        good = "0 0 {} 0 0 0 {} -1 -1 {} {} 0 0 0"
        rows = [good.format(*v) for v in ((0, 9, -1, 1), ("nan", 9, -1, 1), (0, "inf", -1, 1), (0, 9, 200, 1), (0, 9, -1, 0), (1, "-inf", -1, 1))]
        head = self.write_scene(*rows)
        at = head + len(rows[0]) + 1 + 4
        self.refuses(1, ["scene.ply", f"Gaussian 1, z (byte {at})", "NaN", "finite", "--skip-bad"], *self.render())
        out, err = self.succeeds(*self.render("--skip-bad", "--json"))
        for word in ("scene.ply", "3 of 6", "1 with values", "1 with scales", "1 with rotations", f"(byte {at})"):
            self.assertIn(word, err)
        result = json.loads(out)
        self.assertEqual(result["gaussians"], 3)
        self.assertEqual(result["skipped"], {"not_finite": 1, "huge_scale": 1, "zero_rotation": 1})
        self.write_scene(rows[0])
        out, err = self.succeeds(*self.render("--json", "--overwrite"))
        self.assertNotIn("left out", err)
        self.assertEqual(json.loads(out)["skipped"], {"not_finite": 0, "huge_scale": 0, "zero_rotation": 0})

    def test_counts_that_no_file_holds(self):
        for count in (2, 99999999999999, 2**63, 2**64 - 1):
            self.write_scene("0 0 0 0 0 0 9 -1 -1 -1 1 0 0 0", count=count)
            self.refuses(1, ["scene.ply", "element vertex", f"promises {count}", "byte"], *self.render("--skip-bad"))
        for count in (-1, 2**64, "many"):
            self.write_scene("0 0 0 0 0 0 9 -1 -1 -1 1 0 0 0", count=count)
            self.refuses(1, ["scene.ply", "line 3", "element vertex", f'"{count}"'], *self.render())

    def test_bytes_beyond_what_is_promised(self):
        self.write_scene(*["0 0 0 0 0 0 9 -1 -1 -1 1 0 0 0"] * 3, count=2)
        _, err = self.succeeds(*self.render())
        self.assertIn("warning", err)
        self.assertIn("bytes after the last element", err)

    def test_cut_off(self):
        good = "0 0 0 0 0 0 9 -1 -1 -1 1 0 0 0"
        head = self.write_scene(good, good)
        os.truncate(self.path("scene.ply"), head + len(good) + 3)
        size = os.path.getsize(self.path("scene.ply"))
        self.refuses(1, ["scene.ply", "element vertex", "promises 2 of", f"from byte {head} on", f"{size} bytes"], *self.render("--skip-bad"))
        os.truncate(self.path("scene.ply"), 40)
        self.refuses(1, ["scene.ply", "line 4 (byte 38)", "before end_header"], *self.render())

    def test_pipe_that_nobody_writes_to(self):
        os.mkfifo(self.path("pipe.ply"))
        code, _, err = support.run("render", self.path("pipe.ply"), "--cameras", "orbit:1", "--images", self.path("x"))
        self.assertEqual(code, 1, err)
        self.assertIn("pipe.ply: is no regular file", err)

    def test_gaussians_as_far_and_large_as_floats_go(self):
        good = "0 0 0 0 0 0 9 -1 -1 -1 1 0 0 0"
        row = lambda position, sh, scale: f"{position} {sh} 0 0 9 {scale} 1 0 0 0"
        self.write_scene(good, *[row(p, s, e) for p in ("0 0 0", "3e38 0 0", "3e38 -3e38 3e38") for s in ("0", "3e38", "-3e38")
                                 for e in ("88 88 88", "-1000 88 -1", "-1000 -1000 -1000")])
        camera = {"file": "a.png", "w": 33, "h": 17, "fx": 30, "fy": 30, "cx": 16, "cy": 8,
                  "w2c": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]}
        json.dump([camera], open(self.path("cameras.json"), "w"))
        pictures = []
        for kernels in ("cpu", "gpu"):
            self.succeeds("render", self.path("scene.ply"), "--cameras", self.path("cameras.json"), "--images", self.path(kernels), "--kernels", kernels)
            pictures.append(support.read_png(self.path(kernels, "0000.png")))
        self.assertGreater(support.psnr(pictures[0][2], pictures[1][2]), 40)

    def test_cameras_that_are_none(self):
        self.write_scene("0 0 0 0 0 0 9 -1 -1 -1 1 0 0 0")
        pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]
        frame = lambda **more: {"frames": [{"file_path": "a.png", "w": 8, "h": 8, "fl_x": 8, "transform_matrix": pose, **more}]}
        path = self.path("transforms.json")
        render = ("render", self.path("scene.ply"), "--cameras", path, "--images", self.path("x"))
        for words, content in ((["frame 0 (a.png)", "coefficient k1 is 1e+300"], frame(k1=1e300)),
                               (["frame 0 (a.png)", "transform_matrix[0][0] is NaN"], frame(transform_matrix=[[float("nan")] * 4] * 4)),
                               (["frame 0 (a.png)", "singular"], frame(transform_matrix=[[1, 0, 0, 0]] * 3 + [[0, 0, 0, 1]])),
                               (["frame 0 (a.png)", "w is 1000000000"], frame(w=1e9)),
                               (["frame 0 (a.png)", "focal length fx is -8"], frame(fl_x=-8))):
            json.dump(content, open(path, "w"))
            self.refuses(1, ["transforms.json", *words], *render)
        open(path, "w").write('{"frames": ' + "[" * 200000 + "]" * 200000 + "}")
        self.refuses(1, ["transforms.json", "nested deeper"], *render)

    def test_damaged_selection(self):
        for text, line in (("3\n2\n", 2), ("2\n2\n", 2), ("# of another model\n999999999\n", 2), ("-1\n", 1), ("1\nx\n", 2), ("3 x\n", 1),
                           ("3.0\n", 1), ("9" * 30 + "\n", 1)):
            open(self.path("voxels.txt"), "w").write(text)
            self.refuses(1, ["voxels.txt", f"line {line}"], *self.reconstruct("--selection", self.path("voxels.txt")))

    def test_files_of_another_kind(self):
        self.succeeds(*self.reconstruct())
        picture, scene = self.path("views", "images", "0.png"), self.path("out.ply")
        for path in (scene, self.folder, picture, self.views):
            self.refuses(1, path, "weights", "verify", path)
        for path in (self.model, self.folder, picture):
            self.refuses(1, path, "render", path, "--cameras", "orbit:1", "--images", self.path("x"))
            self.refuses(1, path, "render", scene, "--cameras", path, "--images", self.path("x"))


if __name__ == "__main__":
    support.main()
