"""Several devices at once: the results equal those of one device, to the byte, and lists of objects lose nothing."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import support
import train_support

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "hostile"))
import pictures  # noqa: E402

TWO = {"POCL_DEVICES": "pthread pthread", "VSPLAT_DEVICE": ""}
MIXED = {"POCL_DEVICES": "basic pthread", "VSPLAT_DEVICE": ""}
PLATFORMS = {"RUSTICL_ENABLE": "llvmpipe", "VSPLAT_DEVICE": ""}


class Share(support.Case):
    def files(self, *parts):
        folder = self.path(*parts)
        return {name: pathlib.Path(folder, name).read_bytes() for name in sorted(os.listdir(folder))}

    def equal(self, run, env=TWO):
        """run(devices, folder) returns arguments. Returns what stderr says about both devices."""
        for folder, devices in (("one", "0"), ("two", "0,1"), ("all", "all")):
            _, err = self.succeeds(*run(devices, folder), env=env)
        self.assertIn("device 0:", err)
        self.assertIn("device 1:", err)
        return err

    def test_pictures_are_the_same(self):
        scene = self.path("scene.ply")
        support.write_scene(scene, [((0.1 * i, 0.05 * i, 0), (0.5, 0.1 * i, 0.2), 0.1, 0.8) for i in range(8)])
        for env in (TWO, MIXED):
            self.equal(lambda devices, folder: ("render", scene, "--cameras", "orbit:13", "--size", "32x24", "--images", self.path(folder), "--sheet",
                                                self.path(folder, "sheet.png"), "--turntable", self.path(folder, "turn.webp"), "-d", devices, "-w"), env)
            self.assertEqual(len(self.files("one")), 15)
            self.assertEqual(self.files("one"), self.files("two"))
            self.assertEqual(self.files("one"), self.files("all"))

    @support.slow
    def test_scores_are_the_same(self):
        """In the quick tests: a list and pictures, which are shared in the same way."""
        self.succeeds("dataset", "procedural", "--count", 5, "--solids", "--output", self.path("set"), "--views", 9, "--size", self.SIDE, "--seed", 4)
        arguments = ("evaluate", self.path("set"), "--model", self.model, "--json")
        one, _ = self.succeeds(*arguments, "--sheet", self.path("one.png"), "-d", "0", env=TWO)
        two, _ = self.succeeds(*arguments, "--sheet", self.path("two.png"), "-d", "0,1", env=TWO)
        self.assertEqual(one, two)
        self.assertEqual(pathlib.Path(self.path("one.png")).read_bytes(), pathlib.Path(self.path("two.png")).read_bytes())
        self.assertEqual([o["name"] for o in json.loads(two)["objects"]], [f"solid_{i:04}" for i in range(5)])
        table = self.path("table.json")
        with open(table, "w") as f:
            json.dump({"systems": [{"name": "ours", "model": self.model}], "data": [{"name": "solids", "folders": [self.path("set")]}]}, f)
        rows = [self.succeeds("evaluate", "--table", table, "--json", "-d", d, env=TWO)[0] for d in ("0", "all")]
        psnr = [json.loads(text)["rows"][0]["psnr"] for text in rows]
        self.assertEqual(psnr[0], psnr[1])

    @support.slow
    def test_devices_of_two_platforms_agree(self):
        result = json.loads(self.succeeds("devices", "--json", env=PLATFORMS)[0])
        if len({device["platform"] for device in result}) < 2:
            self.skipTest("there is one platform")
        self.succeeds("dataset", "procedural", "--count", 4, "--solids", "--output", self.path("set"), "--views", 9, "--size", self.SIDE, "--seed", 4)
        evaluation = lambda devices: json.loads(self.succeeds("evaluate", self.path("set"), "--model", self.model, "--json", "-d", devices, env=PLATFORMS)[0])
        one, both = evaluation("0"), evaluation("all")
        for a, b in zip(one["objects"], both["objects"]):
            self.assertEqual(a["name"], b["name"])
            self.assertAlmostEqual(a["psnr"], b["psnr"], delta=0.01)
        scene = self.path("scene.ply")
        support.write_scene(scene, [((0.1 * i, 0.05 * i, 0), (0.5, 0.1 * i, 0.2), 0.1, 0.8) for i in range(8)])
        for folder, devices in (("one", "0"), ("both", "all")):
            self.succeeds("render", scene, "--cameras", "orbit:8", "--size", "32x24", "--images", self.path(folder), "-d", devices, env=PLATFORMS)
        for name in self.files("one"):
            a, b = (support.read_png(self.path(folder, name))[2] for folder in ("one", "both"))
            self.assertLessEqual(max(abs(x - y) for x, y in zip(a, b)), 1, name)
        arguments = self.write_list(self.listed(4))
        for folder, devices in (("scenes1", "0"), ("scenes2", "all")):
            self.succeeds(*arguments, "--output", self.path(folder), "-d", devices, env=PLATFORMS)
        self.assertEqual({k: len(v) for k, v in self.files("scenes1").items()}, {k: len(v) for k, v in self.files("scenes2").items()})

    def listed(self, count):
        for i in range(count):
            self.make_views(f"object{i}", centre=(0.1 * i, 0, 0))
        return [self.path(f"object{i}") for i in range(count)]

    def write_list(self, lines):
        pathlib.Path(self.path("list.txt")).write_text("".join(line + "\n" for line in lines))
        return ("reconstruct", "--list", self.path("list.txt"), "--model", self.model, "--center", "0,0,0", "--scale", "1")

    def test_a_list_is_what_its_objects_are(self):
        objects = self.listed(5)
        arguments = self.write_list([objects[0], "", objects[1] + "/", objects[2] + "/transforms.json", objects[3] + "\tnamed", objects[4]])
        self.equal(lambda devices, folder: (*arguments, "--output", self.path(folder), "-d", devices))
        names = ["named.ply"] + [f"object{i}.ply" for i in (0, 1, 2, 4)]
        self.assertEqual(list(self.files("one")), names)
        self.assertEqual(self.files("one"), self.files("two"))
        self.assertEqual(self.files("one"), self.files("all"))
        self.succeeds("reconstruct", objects[3], "--model", self.model, "--center", "0,0,0", "--scale", "1", "--output", self.path("alone.ply"), env=TWO)
        self.assertEqual(pathlib.Path(self.path("alone.ply")).read_bytes(), self.files("one")["named.ply"])

    def test_the_list_may_come_from_a_pipe(self):
        objects = self.listed(2)
        arguments = [a if a != self.path("list.txt") else "-" for a in self.write_list([])]
        done = subprocess.run([support.VSPLAT, *arguments, "--output", self.path("out"), "--json"], input="\n".join(objects), text=True,
                              capture_output=True, timeout=support.PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual([o["output"] for o in result["objects"]], [self.path("out", f"object{i}.ply") for i in range(2)])
        self.assertTrue(all(o["gaussians"] >= 0 and o["seconds"] > 0 for o in result["objects"]))

    def test_what_cannot_be_read_takes_nothing_with_it(self):
        objects = self.listed(4)
        os.remove(os.path.join(objects[1], "images", "0.png"))
        pathlib.Path(os.path.join(objects[1], "transforms.json")).write_text("{")
        arguments = (*self.write_list([*objects, self.path("missing")]), "--output", self.path("out"))
        code, out, err = support.run(*arguments, "--json", "-d", "0,1", env=TWO)
        self.assertEqual(code, 1, err)
        self.assertIn("2 of 5 objects could not be reconstructed", err)
        self.assertIn("transforms.json", err)
        self.assertIn("missing", err)
        self.assertEqual(list(self.files("out")), ["object0.ply", "object2.ply", "object3.ply"])
        self.assertEqual(["error" in o for o in json.loads(out)["objects"]], [False, True, False, False, True])
        # After the repair, only the rest is computed.
        before = os.stat(self.path("out", "object0.ply")).st_mtime_ns
        support.shutil.rmtree(objects[1])
        self.make_views("object1")
        self.write_list(objects)
        self.refuses(1, ["object0.ply exists", "--overwrite"], *arguments)
        _, err = self.succeeds(*arguments, "--skip-existing")
        self.assertIn("1 scene, 3 were there", err)
        self.assertEqual(os.stat(self.path("out", "object0.ply")).st_mtime_ns, before)
        self.assertEqual(len(self.files("out")), 4)
        _, err = self.succeeds(*arguments, "--skip-existing")
        self.assertIn("0 scenes, 4 were there", err)

    def test_a_picture_beyond_memory_is_its_objects_trouble(self):
        objects = self.listed(3)
        big = os.path.join(objects[1], "images", "0.png")
        with open(big, "wb") as f:  # interlaced: the whole picture is in memory at once
            f.write(pictures.png(9000, 9000, pictures.zeros(pictures.interlaced_rows(9000, 9000, 8, 2)), interlaced=1))
        listed = json.loads(pathlib.Path(os.path.join(objects[1], "transforms.json")).read_text())
        listed.update(w=9000, h=9000)
        pathlib.Path(os.path.join(objects[1], "transforms.json")).write_text(json.dumps(listed))
        code, _, err = support.run(*self.write_list(objects), "--output", self.path("out"), "-d", "0,1", "--max-host-memory", "0.1", env=TWO)
        self.assertEqual(code, 1, err)
        self.assertIn("1 of 3 objects could not", err)
        self.assertNotIn("no more work", err)
        self.assertEqual(list(self.files("out")), ["object0.ply", "object2.ply"])

    def test_an_interrupt_keeps_what_is_made(self):
        views = self.listed(1)[0]
        arguments = (*self.write_list([f"{views}\tn{i}" for i in range(4000)]), "--output", self.path("out"))
        process = subprocess.Popen([support.VSPLAT, *arguments, "-d", "0,1"], env={**os.environ, **TWO}, stderr=subprocess.PIPE, text=True)
        end = time.time() + support.PATIENCE
        while time.time() < end and not os.path.exists(self.path("out", "n5.ply")):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=support.PATIENCE)
        self.assertEqual(process.returncode, 130, err)
        self.assertIn("--skip-existing continues", err)
        made = self.files("out")
        self.assertTrue(6 <= len(made) < 4000, len(made))
        self.assertEqual(len(set(made.values())), 1)  # complete files

    def test_refusals(self):
        two = self.write_list([self.views, self.views])
        self.refuses(2, ["line 2", "as that of line 1"], *two, "--output", self.path("out"))
        for line, word in ((self.views + "\t../x", "../x"), (self.views + "\t", '""'), (self.views + "\ta\tb", "name is")):
            self.refuses(2, ["line 1", word], *self.write_list([line]), "--output", self.path("out"))
        self.refuses(2, "lists no views", *self.write_list(["", "  "]), "--output", self.path("out"))
        one = self.write_list([self.views])
        self.refuses(2, "needs --output", *one)
        self.refuses(1, "nolist.txt", *[a if a != self.path("list.txt") else self.path("nolist.txt") for a in one], "--output", self.path("out"))
        self.refuses(2, "--list", *one, "--output", self.path("out"), "--refine")
        self.refuses(2, "--list", *one, self.views, "--output", self.path("out"))
        self.refuses(2, "VIEWS", "reconstruct", "--output", self.path("out.ply"))
        self.refuses(2, "--skip-existing", *self.reconstruct("--skip-existing"))
        self.refuses(2, ["2 devices", "takes one"], *self.reconstruct("-d", "0,1"), env=TWO)
        self.refuses(2, "twice", *one, "--output", self.path("out"), "-d", "0,0", env=TWO)
        self.refuses(1, ["no device is", "7"], *one, "--output", self.path("out"), "-d", "0,7", env=TWO)
        self.refuses(2, "one device", *one, "--output", self.path("out"), "-d", "0,1", "--profile", self.path("p.json"), env=TWO)


class Train(train_support.Case):
    def test_the_same_bytes_on_any_number_of_devices(self):
        config = self.config(batch=2, accumulate=2, parts=3)
        for run, devices, env in (("one", "0", TWO), ("two", "0,1", TWO), ("three", "all", {**TWO, "POCL_DEVICES": "pthread pthread pthread"})):
            _, err = self.succeeds(*self.train(config, run, "-d", devices), env=env)
            self.assertEqual(err.count("driver"), {"one": 1, "two": 2, "three": 3}[run], err)
        self.same_training("one", "two", 6)
        self.same_training("one", "three", 6)

    def test_resumed_on_another_number_of_devices(self):
        config = self.config(batch=3, parts=3, steps=4)
        self.succeeds(*self.train(config, "whole", "-d", "0"), env=TWO)
        self.succeeds(*self.train(config, "resumed", "-d", "0,1"), env=TWO)
        for name in ("checkpoint-00000004.safetensors", "model.safetensors"):
            os.remove(self.path("resumed", name))
        self.succeeds(*self.train(config, "resumed", "-d", "0", "--resume"), env=TWO)
        self.same_training("whole", "resumed", 4)

    def test_one_part_is_one_device(self):
        self.refuses(2, ["--device", "parts is 1", "2 to 4"], *self.train(self.config(batch=4), "run", "-d", "0,1"), env=TWO)
        self.refuses(1, ["parts", "1 to 2"], *self.train(self.config(batch=2, parts=3), "run"))

    @support.slow
    def test_two_platforms_keep_their_parts(self):
        """In the quick tests: two devices of one platform, which share shards in the same way."""
        if len({device["platform"] for device in json.loads(self.succeeds("devices", "--json", env=PLATFORMS)[0])}) < 2:
            self.skipTest("there is one platform")
        config = self.config(batch=4, parts=4, steps=6, checkpoint_every=3)
        _, err = self.succeeds(*self.train(config, "whole", "-d", "all"), env=PLATFORMS)
        self.assertNotIn("other kinds", err)
        os.makedirs(self.path("resumed"))
        for name in ("config.json", "log.csv", "checkpoint-00000003.safetensors"):
            shutil.copy(self.path("whole", name), self.path("resumed", name))
        _, err = self.succeeds(*self.train(config, "resumed", "-d", "all", "--resume"), env=PLATFORMS)
        self.assertNotIn("other kinds", err)
        self.same_training("whole", "resumed", 6)


if __name__ == "__main__":
    support.main()
