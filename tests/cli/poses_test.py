"""vsplat poses: every step and sentence with programs in place of COLMAP and ffmpeg, and, where it is installed, COLMAP itself."""
import json
import math
import os
import pathlib
import random
import shutil
import signal
import struct
import subprocess
import sys
import time
import unittest

import support


# In place of COLMAP: `plan` in its folder says how it behaves, `calls` gets its arguments. Its database lists pictures and their cameras.
COLMAP = r'''
import json, os, re, struct, sys, time
here = os.path.dirname(os.path.abspath(__file__))
plan = json.load(open(os.path.join(here, "plan")))
words = sys.argv[1:]
with open(os.path.join(here, "calls"), "a") as f:
    f.write(json.dumps(words) + "\n")
new = plan.get("new", False)
options = {"feature_extractor": ["database_path", "image_path", "image_list_path", "ImageReader.mask_path", "ImageReader.camera_model", "ImageReader.existing_camera_id",
                                 "ImageReader.single_camera_per_image", "FeatureExtraction.use_gpu" if new else "SiftExtraction.use_gpu"],
           "mapper": ["database_path", "image_path", "output_path"]}
for name, more in (("exhaustive", ["ExhaustiveMatching.block_size"]), ("sequential", ["SequentialMatching.loop_detection", "SequentialMatching.vocab_tree_path"]),
                   ("vocab_tree", ["VocabTreeMatching.vocab_tree_path"])):
    options[name + "_matcher"] = ["database_path", "FeatureMatching.use_gpu" if new else "SiftMatching.use_gpu", *more]
if words == ["help"]:
    print(plan.get("help", "COLMAP 4.1.0 -- Structure-from-Motion\n  (Commit x on y with CUDA)" if new else "COLMAP 3.8 -- Structure-from-Motion\n  (Commit x on y without CUDA)"))
    sys.exit(0)
command = words[0]
known = [name for name in options[command] if name not in plan.get("lacks", [])]
if words[1:] == ["--help"]:
    print("  -h [ --help ]\n" + "".join(f"  --{name} arg (=1)\n" for name in known))
    sys.exit(0)
given = dict(zip((word[2:] for word in words[1::2]), words[2::2]))
assert all(name in known for name in given), given
if command in plan.get("fails", {}):
    print(plan["fails"][command])
    sys.exit(1)
database = given["database_path"]
pictures = json.load(open(database)) if os.path.exists(database) else {}
def prints(text):
    print("I20260101 00:00:00.000000 7 x.cc:1] " + text if new else text, flush=True)
def wait(step):
    while plan.get("waits") == step and os.path.exists(os.path.join(here, "wait")):
        time.sleep(0.02)
if command == "feature_extractor":
    names = open(given["image_list_path"]).read().split("\n")[:-1]
    for i, name in enumerate(names):
        if i == 2:
            wait("features")
        assert os.path.isfile(os.path.join(given["image_path"], name))
        if "ImageReader.mask_path" in given:
            assert os.path.isfile(os.path.join(given["ImageReader.mask_path"], name + ".png"))
        if name not in pictures:
            pictures[name] = int(given.get("ImageReader.existing_camera_id", len(pictures) + 1))
        json.dump(pictures, open(database, "w"))
        prints(f"Processed file [{i + 1}/{len(names)}]")
        prints(f"  Name:            {name}")
        prints(f"  Features:        {100 + i}" + (" (SIFT)" if new else ""))
elif command.endswith("_matcher"):
    prints("Matching block [1/2, 1/2]")
    wait("matches")
    open(database + ".matched", "w").close()
else:
    if plan.get("models") == []:
        prints("  => No good initial image pair found.\nERROR: failed to create sparse model")
        sys.exit(1)
    left = sorted(pictures)
    for k, count in enumerate(plan.get("models", [len(left)])):
        out = os.path.join(given["output_path"], str(k))
        os.mkdir(out)
        own, left = left[:count], left[count:]
        with open(os.path.join(out, "images.bin"), "wb") as f:
            f.write(struct.pack("<Q", count))
            for i, name in enumerate(own):
                prints(f"Registering image #{i + 1} (" + ("num_reg_frames=" if new else "") + f"{i + 1})")
                f.write(struct.pack("<i7di", i + 1, 1, 0, 0, 0, 0.1 * i, 0, 2, pictures[name]) + name.encode() + b"\0" + struct.pack("<Q", 0))
        cameras = sorted(set(pictures.values()))
        with open(os.path.join(out, "cameras.bin"), "wb") as f:
            f.write(struct.pack("<Q", len(cameras)))
            for camera in cameras:
                f.write(struct.pack("<iiQQ4d", camera, 2, 16, 16, 20, 8, 8, 0))
        with open(os.path.join(out, "points3D.bin"), "wb") as f:
            f.write(struct.pack("<Q", 2))
            for i, error in enumerate((0.5, 1.0)):
                f.write(struct.pack("<Q3d3Bd", i + 1, 0.1 * i, 0, 0, 200, 100, 50, error) + struct.pack("<Q4i", 2, 1, 0, 2, 0))
            if plan.get("damaged"):
                f.truncate(60)
'''

# In place of ffmpeg: a "video" is a text file with the number of its seconds; frame i of a rate is the picture i of a folder `frames`.
FFMPEG = r'''
import os, shutil, sys
words = sys.argv[1:]
seconds = float(open(words[words.index("-i") + 1]).read())
print(f"  Duration: 00:00:{seconds:05.2f}, start: 0.000000")
if "-vf" not in words:
    sys.exit(1)
rate = float(words[words.index("-vf") + 1].split("=")[1])
here = os.path.dirname(os.path.abspath(__file__))
for i in range(int(rate * seconds)):
    with open(words[-1] % (i + 1), "wb") as f:
        f.write(open(os.path.join(here, "frame.jpg"), "rb").read() + b"x" * (1000 if i % 5 == 3 else i))
    sys.stdout.write(f"frame={i} time=00:00:{i / rate:05.2f} bitrate=1\r")
print()
'''


def jpeg_with_exif(jpeg, model, focal):
    """Adds EXIF data that name a camera and a focal length in millimetres."""
    text = model.encode() + b"\0"
    text += b"\0" * (len(text) % 2)
    at = 8 + 2 + 2 * 12 + 4  # behind the first directory
    first = struct.pack("<H", 2) + struct.pack("<HHII", 0x110, 2, len(text), at) + struct.pack("<HHII", 0x8769, 4, 1, at + len(text)) + b"\0" * 4
    behind = at + len(text) + 2 + 12 + 4
    second = struct.pack("<H", 1) + struct.pack("<HHII", 0x920A, 5, 1, behind) + b"\0" * 4 + struct.pack("<II", focal, 1)
    exif = b"Exif\0\0II*\0\x08\0\0\0" + first + text + second
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]


class Folder(support.FolderCase):
    def jpegs(self, count):
        """Pictures of 16 x 16 pixels, drawn by this command."""
        scene = self.path("scene.ply")
        support.write_scene(scene, [((0.3 * i, 0, 0), (1, 0.5, 0), 0.2, 0.9) for i in range(3)])
        self.succeeds("render", scene, "--cameras", f"orbit:{count}", "--size", "16x16", "--format", "jpg", "--images", self.path("drawn"), "--quiet")
        return [pathlib.Path(self.path("drawn", f"{i:04}.jpg")).read_bytes() for i in range(count)]


class StandIn(Folder):
    """With programs in place of COLMAP and ffmpeg, alone in PATH."""

    def setUp(self):
        super().setUp()
        os.mkdir(self.path("bin"))
        for name in ("sh", "cp"):
            os.symlink(shutil.which(name), self.path("bin", name))
        self.program("colmap", COLMAP)
        self.plan()
        self.environment = {"PATH": self.path("bin"), "HOME": self.folder}
        self.make_views("photos", 6)
        self.pictures, self.out = self.path("photos", "images"), self.path("out")

    def program(self, name, text):
        path = self.path("bin", name)
        pathlib.Path(path).write_text(f"#!{sys.executable}\n{text}")
        os.chmod(path, 0o755)

    def plan(self, **plan):
        pathlib.Path(self.path("bin", "plan")).write_text(json.dumps(plan))

    def calls(self, command=None):
        path = pathlib.Path(self.path("bin", "calls"))
        calls = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        return [c for c in calls if c[0] not in ("help",) and c[1:] != ["--help"] and command in (None, c[0])]

    def poses(self, *more, code=0, pictures=None):
        got, out, err = support.run("poses", pictures or self.pictures, "--output", self.out, *more, env=self.environment)
        self.assertEqual(got, code, err)
        self.last = err
        return json.loads(out) if "--json" in more and code == 0 else err

    def refused(self, words, *more, code=1, pictures=None):
        before = self.snapshot()
        err = self.poses(*more, code=code, pictures=pictures)
        for word in words:
            self.assertIn(word, err)
        after = {path: data for path, data in self.snapshot().items() if not path.endswith("calls")}
        self.assertEqual({path: data for path, data in before.items() if not path.endswith("calls")}, after)

    def value(self, call, option):
        return call[call.index(option) + 1]

    def test_a_folder_that_others_read(self):
        result = self.poses("--json")
        self.assertEqual((result["pictures"], result["registered"], result["points"], result["missing"], result["models"]), (6, 6, 2, [], [6]))
        self.assertAlmostEqual(result["reprojection_error"], 0.75)
        self.assertIn("cameras of 6 of 6 pictures, 2 points, mean reprojection error 0.75 pixels, 1 lens", self.last)
        self.assertIn(f"next: vsplat fit {self.out} --output scene.ply", self.last)
        self.assertEqual(sorted(os.listdir(self.out)), ["images", "logs", "poses.json", "sparse"])
        self.assertEqual(sorted(os.listdir(self.path("out", "sparse", "0"))), ["cameras.bin", "images.bin", "points3D.bin"])
        self.assertFalse(os.path.exists(self.out + ".unfinished"))
        self.assertEqual(json.loads(pathlib.Path(self.path("out", "poses.json")).read_text()), {**result})
        # A second name of each picture, not a link, which may not lead out of the folder.
        picture = self.path("out", "images", "3.png")
        self.assertTrue(os.path.samefile(picture, self.path("photos", "images", "3.png")) and not os.path.islink(picture))
        described = json.loads(self.succeeds("dataset", "info", self.out, "--json", "--check")[0])
        self.assertEqual((described["objects"][0]["views"], described["bad"]), (6, 0))
        first, rest = self.calls("feature_extractor")
        self.assertEqual(self.value(first, "--ImageReader.single_camera_per_image"), "1")
        self.assertEqual(self.value(rest, "--ImageReader.existing_camera_id"), "1")
        self.assertEqual(self.value(rest, "--ImageReader.camera_model"), "SIMPLE_RADIAL")
        self.assertEqual(self.value(rest, "--SiftExtraction.use_gpu"), "0")
        self.assertEqual(self.value(self.calls("exhaustive_matcher")[0], "--SiftMatching.use_gpu"), "0")

    def test_options_are_named_as_the_version_does(self):
        self.plan(new=True)
        result = self.poses("--json", "--gpu", "on", "--lens", "opencv")
        self.assertEqual((result["colmap"], result["registered"], result["gpu"], result["camera_model"]), ("4.1", 6, True, "OPENCV"))
        self.assertEqual(self.value(self.calls("feature_extractor")[0], "--FeatureExtraction.use_gpu"), "1")
        self.assertEqual(self.value(self.calls("exhaustive_matcher")[0], "--FeatureMatching.use_gpu"), "1")
        self.plan(new=True, lacks=["ImageReader.existing_camera_id"])
        self.out = self.path("other")
        self.assertIn("lists no option --ImageReader.existing_camera_id", self.poses(code=1))
        self.plan()
        self.refused(["--gpu on", "without CUDA"], "--gpu", "on", code=2)

    def test_no_colmap_and_others(self):
        self.plan(help="COLMAP 3.6 -- Structure-from-Motion")
        self.refused([self.path("bin", "colmap"), "COLMAP 3.6", "3.8 or later is needed"])
        self.plan(help="usage: something else")
        self.refused(["is not COLMAP", "something else"])
        self.plan(help="COLMAP 5.2 -- Structure-from-Motion")
        self.assertIn("warning: COLMAP 5.2 is newer than", self.poses())
        os.remove(self.path("bin", "colmap"))
        self.out = self.path("other")
        self.refused(["COLMAP, which finds the cameras, is not installed", "apt install colmap", "brew install colmap", "conda"])
        self.refused(["--colmap /nowhere/colmap: no such program"], "--colmap", "/nowhere/colmap")

    def test_a_step_that_fails(self):
        self.plan(fails={"feature_extractor": "one\ntwo\nERROR: it broke"})
        err = self.poses(code=1)
        log = self.out + ".unfinished/logs/features.txt"
        self.assertIn("COLMAP's feature_extractor failed (exit code 1); its last lines:\n  one\n  two\n  ERROR: it broke\nAll of them are in " + log, err)
        self.assertIn("it broke", pathlib.Path(log).read_text())
        self.assertFalse(os.path.exists(self.out))
        self.plan(fails={"mapper": "std::bad_alloc"})
        self.assertIn("std::bad_alloc", self.poses(code=1))
        self.plan()
        self.assertIn("going on with what an earlier run has finished", self.poses())
        self.assertEqual(len(self.calls("exhaustive_matcher")), 1)

    def test_a_damaged_result(self):
        self.plan(damaged=True)
        self.assertIn("a damaged file of points", self.poses(code=1))
        self.assertFalse(os.path.exists(self.out))

    def test_some_pictures_or_none_have_cameras(self):
        self.plan(models=[4])
        result = self.poses("--json")
        self.assertEqual((result["registered"], [m["name"] for m in result["missing"]]), (4, ["4.png", "5.png"]))
        self.assertIn("cameras of 4 of 6 pictures", self.last)
        self.assertIn("without a camera: 4.png (103 features), 5.png (104 features)", self.last)
        self.assertNotIn("warning", self.last)
        self.plan(models=[2])
        self.assertIn("warning: fewer than half of the pictures have a camera", self.poses("--overwrite"))
        self.plan(models=[2, 3])
        err = self.poses("--overwrite")
        self.assertIn("made 2 models, of 3, 2 pictures: the largest is kept", err)
        self.assertIn("cameras of 3 of 6 pictures", err)
        self.assertEqual(os.listdir(self.path("out", "sparse")), ["0"])
        self.plan(models=[])
        self.out = self.path("none")
        self.assertIn("COLMAP found no camera: no two of the 6 pictures show enough of the same", self.poses(code=1))
        self.assertFalse(os.path.exists(self.out))

    def test_interrupted_and_gone_on_with(self):
        for step, words in (("features", []), ("matches", ["feature_extractor"])):
            with self.subTest(step=step):
                open(self.path("bin", "wait"), "w").close()
                self.plan(waits=step)
                self.out = self.path("out-" + step)
                process = subprocess.Popen([support.VSPLAT, "poses", self.pictures, "--output", self.out], stderr=subprocess.PIPE, text=True,
                                           env={**os.environ, **self.environment})
                log = pathlib.Path(self.out + ".unfinished", "logs", "features-2.txt" if step == "features" else "matches.txt")
                for _ in range(600):
                    if log.exists() and ("Processed file [2/5]" if step == "features" else "block") in log.read_text():
                        break
                    time.sleep(0.05)
                process.send_signal(signal.SIGINT)
                err = process.communicate(timeout=support.PATIENCE)[1]
                self.assertEqual(process.returncode, 130, err)
                self.assertIn(f"stopped; what is finished is in {self.out}.unfinished, and the same command goes on from there", err)
                self.assertFalse(os.path.exists(self.out))
                os.remove(self.path("bin", "wait"))
                os.remove(self.path("bin", "calls"))
                time.sleep(0.2)
                self.assertFalse(os.path.exists(self.out + ".unfinished/database.db.matched"), "COLMAP went on")
                self.assertIn("going on with", self.poses())
                self.assertEqual([c[0] for c in self.calls()], ["feature_extractor"] * (step == "features") + ["exhaustive_matcher", "mapper"])
                database = {p: 1 for p in sorted(os.listdir(self.pictures))}
                images = pathlib.Path(self.out, "sparse", "0", "images.bin").read_bytes()
                self.assertTrue(all(name.encode() in images for name in database))
                cameras = pathlib.Path(self.out, "sparse", "0", "cameras.bin").read_bytes()
                self.assertEqual(struct.unpack("<Q", cameras[:8])[0], 1)  # the rest of the pictures got the same camera
        # Other pictures begin again.
        self.plan(fails={"mapper": "no"})
        self.out = self.path("again")
        self.poses(code=1)
        shutil.copy(self.path("photos", "images", "0.png"), self.path("photos", "images", "9.png"))
        self.plan()
        self.assertIn("an earlier run had other pictures or options; begins again", self.poses())
        self.assertIn("cameras of 7 of 7", self.last)

    def test_lenses_by_exif_and_size(self):
        jpegs = self.jpegs(5)
        os.mkdir(self.path("lenses"))
        for i, (model, focal) in enumerate((("Box A", 24), ("Box B", 24), ("Box A", 24), ("Box A", 50), ("Box B", 24))):
            pathlib.Path(self.path("lenses", f"{i}.jpg")).write_bytes(jpeg_with_exif(jpegs[i], model, focal))
        result = self.poses("--json", pictures=self.path("lenses"))
        self.assertEqual([(lens["lens"], lens["pictures"]) for lens in result["lenses"]], [("Box A, 24.0 mm", 2), ("Box B, 24.0 mm", 2), ("Box A, 50.0 mm", 1)])
        self.assertEqual([self.value(c, "--ImageReader.existing_camera_id") for c in self.calls("feature_extractor")[1:]], ["1", "2"])
        self.assertIn("5 pictures by 3 lenses", self.last)

    def test_which_pictures_are_compared(self):
        def matcher(count, name, *more):
            self.out = self.path(f"out{len(os.listdir(self.folder))}")
            folder = self.path(f"many-{len(os.listdir(self.folder))}")
            os.mkdir(folder)
            for i in range(count):
                os.link(self.path("photos", "images", "0.png"), os.path.join(folder, name.format(i)))
            return self.poses("--json", *more, pictures=folder)["matcher"]
        open(self.path("tree.bin"), "w").close()
        self.assertEqual(matcher(199, "{:04}.png"), "exhaustive")
        self.assertEqual(self.value(self.calls("feature_extractor")[-1], "--ImageReader.camera_model"), "SIMPLE_RADIAL")
        self.assertEqual(matcher(200, "frame_{:04}.png"), "sequential")
        self.assertIn("no vocabulary tree", self.last)
        self.assertEqual(matcher(200, "{:04}x.png"), "exhaustive")
        self.assertIn("all pairs are compared, which takes long", self.last)
        self.assertEqual(matcher(200, "{:04}.png", "--vocabulary", self.path("tree.bin")), "vocabulary")
        self.assertEqual(matcher(3, "{:04}.png", "--matcher", "sequential", "--vocabulary", self.path("tree.bin")), "sequential")
        self.assertEqual(self.value(self.calls("sequential_matcher")[-1], "--SequentialMatching.vocab_tree_path"), self.path("tree.bin"))
        self.out = self.path("none")
        self.refused(["--matcher vocabulary needs --vocabulary"], "--matcher", "vocabulary", code=2)
        self.refused(["tree.nix: no such file"], "--vocabulary", self.path("tree.nix"))

    def test_video(self):
        pathlib.Path(self.path("walk.mp4")).write_text("10")
        self.refused(["walk.mp4: is a video, and ffmpeg, which cuts pictures from it, is not installed", "apt install ffmpeg", "ffmpeg -i walk.mp4"],
                     pictures=self.path("walk.mp4"))
        self.program("ffmpeg", FFMPEG)
        pathlib.Path(self.path("bin", "frame.jpg")).write_bytes(self.jpegs(1)[0])
        self.assertEqual(self.poses("--json", pictures=self.path("walk.mp4"))["pictures"], 40)
        # Among five neighbours, the one with the most bytes.
        sizes = {os.path.getsize(self.path("out", "images", name)) for name in os.listdir(self.path("out", "images"))}
        self.assertEqual(sizes, {os.path.getsize(self.path("bin", "frame.jpg")) + 1000})
        self.out = self.path("more")
        result = self.poses("--json", "--frames", 60, pictures=self.path("walk.mp4"))
        self.assertEqual((result["pictures"], result["matcher"]), (60, "sequential"))
        self.out = self.path("bad")
        pathlib.Path(self.path("bad.mov")).write_text("no video")
        self.assertIn("bad.mov: ffmpeg cut no pictures from it (exit code 1)", self.poses(code=1, pictures=self.path("bad.mov")))
        self.refused(["--frames applies to a video"], "--frames", 5, code=2)

    def test_masks(self):
        self.poses("--mask-command", "cp {picture} {mask}", "--mask-features")
        self.assertEqual(sorted(os.listdir(self.path("out", "masks"))), [f"{i}.png.png" for i in range(6)])
        self.assertEqual(self.value(self.calls("feature_extractor")[0], "--ImageReader.mask_path"), self.out + ".unfinished/masks")
        self.assertLess(json.loads(self.succeeds("dataset", "info", self.out, "--json")[0])["objects"][0]["alpha"], 0.9)  # the masks are used
        self.out = self.path("appended")
        self.poses("--mask-command", "cp")
        self.assertTrue(os.path.exists(self.path("appended", "masks", "0.png.png")))
        # Those beside the pictures go along.
        os.mkdir(self.path("photos", "masks"))
        shutil.copy(self.path("photos", "images", "2.png"), self.path("photos", "masks", "2.png"))
        os.remove(self.path("photos", "transforms.json"))
        self.out = self.path("beside")
        self.poses(pictures=self.path("photos"))
        self.assertEqual(os.listdir(self.path("beside", "masks")), ["2.png"])
        for command, word in (("nosuch", "exit code 127"), ("exit 3 #", "exit code 3"), ("echo hello #", "wrote no"), ("echo > {mask}; echo {picture}", "is no picture")):
            self.out = self.path("refused")
            err = self.poses("--mask-command", command, code=1)
            self.assertIn("--mask-command, for", err)
            self.assertIn(word, err)
            self.assertFalse(os.path.exists(self.out))
            shutil.rmtree(self.out + ".unfinished")
        self.refused(["--mask-features needs masks"], "--mask-features", code=2)

    def test_what_cannot_be_the_output_or_the_input(self):
        self.refused(["no such file or folder"], pictures=self.path("nowhere"))
        self.refused(["a folder of pictures is expected"], pictures=self.path("photos", "images", "0.png"))
        self.refused(["no pictures here"], pictures=self.path("bin"))
        os.mkdir(self.path("two"))
        for i in range(2):
            shutil.copy(self.path("photos", "images", "0.png"), self.path("two", f"{i}.png"))
        self.refused(["2 pictures; cameras are found from three or more"], pictures=self.path("two"))
        shutil.copy(self.path("bin", "plan"), self.path("two", "3.jpg"))
        self.refused(["3.jpg"], pictures=self.path("two"))
        self.out = self.path("photos")
        self.refused(["exists, and is no folder that an earlier `vsplat poses` wrote"], "--overwrite")
        self.out = self.path("out")
        os.mkdir(self.out)
        self.poses()
        self.refused(["out exists (--overwrite replaces it)"])
        os.mkdir(self.path("other.unfinished"))
        open(self.path("other.unfinished", "mine"), "w").close()
        self.out = self.path("other")
        self.refused(["other.unfinished is needed for temporary files, and exists with files of something else"])

    def test_fit_names_the_command(self):
        code, _, err = support.run("fit", self.pictures, "--output", self.path("s.ply"))
        self.assertEqual(code, 1)
        self.assertIn(f"vsplat poses {self.pictures} --output images-posed", err)


@unittest.skipUnless(shutil.which("colmap"), "needs COLMAP, which finds the cameras")
class Colmap(Folder):
    def test_finds_cameras(self):
        """Pictures of a spotted, bumpy surface from ten places: the angles between the cameras are those that they were drawn from."""
        random_ = random.Random(5)
        spots = []
        for _ in range(6000):
            x, y = random_.uniform(-2, 2), random_.uniform(-1.6, 1.6)
            z = 0.35 * math.sin(3 * x) * math.cos(2 * y) + 0.2 * math.sin(5 * y)
            spots.append(((x, y, z), tuple(random_.random() for _ in range(3)), random_.choice((0.015, 0.03, 0.05)), 0.95))
        support.write_scene(self.path("scene.ply"), spots)
        cameras = [self.camera(f"{i:04}.png", math.radians(8 * i - 36), math.radians(6 * math.sin(2 * i))) for i in range(10)]
        pathlib.Path(self.path("cameras.json")).write_text(json.dumps(cameras))
        self.succeeds("render", self.path("scene.ply"), "--cameras", self.path("cameras.json"), "--images", self.path("photos"), "--background", "black")
        result = json.loads(self.succeeds("poses", self.path("photos"), "--output", self.path("out"), "--json")[0])
        self.assertEqual((result["pictures"], result["registered"], result["models"]), (10, 10, [10]), result)
        self.assertLess(result["reprojection_error"], 1)
        self.assertGreater(result["points"], 500)
        drawn = {camera["file"]: [row[:3] for row in camera["w2c"][:3]] for camera in cameras}
        found = self.rotations(self.path("out", "sparse", "0", "images.bin"))
        first = min(found)
        for name in found:
            self.assertAlmostEqual(self.angle(found[first], found[name]), self.angle(drawn[first], drawn[name]), delta=1)

    @staticmethod
    def camera(name, around, above):
        """3.2 units from the origin, to which it looks."""
        width, height, focal, away = 640, 480, 600, 3.2
        forward = [-math.sin(around) * math.cos(above), -math.sin(above), math.cos(around) * math.cos(above)]
        length = math.hypot(forward[0], forward[2])
        right = [forward[2] / length, 0, -forward[0] / length]
        down = [forward[1] * right[2] - forward[2] * right[1], forward[2] * right[0] - forward[0] * right[2],
                forward[0] * right[1] - forward[1] * right[0]]
        rows = [[*right, 0], [*down, 0], [*forward, away], [0, 0, 0, 1]]
        return {"file": name, "w": width, "h": height, "fx": focal, "fy": focal, "cx": width / 2, "cy": height / 2, "w2c": rows}

    @staticmethod
    def angle(a, b):
        """Degrees between two world-to-camera rotations."""
        trace = sum(a[r][c] * b[r][c] for r in range(3) for c in range(3))
        return math.degrees(math.acos(max(-1, min(1, (trace - 1) / 2))))

    @staticmethod
    def rotations(path):
        data, at, out = pathlib.Path(path).read_bytes(), 8, {}
        for _ in range(struct.unpack("<Q", data[:8])[0]):
            w, x, y, z = struct.unpack("<4d", data[at + 4:at + 36])
            end = data.index(b"\0", at + 64)
            out[data[at + 64:end].decode()] = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                                               [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                                               [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
            at = end + 9 + 24 * struct.unpack("<Q", data[end + 1:end + 9])[0]
        return out


if __name__ == "__main__":
    support.main()
