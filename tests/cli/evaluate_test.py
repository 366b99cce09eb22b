"""vsplat evaluate: its contract. tests/reference/pytorch/check_evaluate.py checks the numbers themselves."""
import array
import csv
import json
import math
import os
import pathlib
import random
import struct

import support

NUMBERS = ["psnr", "psnr_coarse", "ssim", "psnr_white", "psnr_nearest", "selected"]


def write_alexnet(path, seed=1):
    """Random weights with the right shapes for LPIPS."""
    rng, header, values, at = random.Random(seed), {}, array.array("f"), 0
    convolutions = [(0, 3, 64, 11), (3, 64, 192, 5), (6, 192, 384, 3), (8, 384, 256, 3), (10, 256, 256, 3)]
    for k, (index, cin, cout, side) in enumerate(convolutions):
        bound = (6 / (cin * side * side)) ** 0.5
        for name, shape, low, high in [(f"features.{index}.weight", [cout, cin, side, side], -bound, bound),
                                       (f"features.{index}.bias", [cout], -0.1, 0.1), (f"lin{k}.model.1.weight", [1, cout, 1, 1], 0, 1)]:
            count = math.prod(shape)
            header[name] = {"dtype": "F32", "shape": shape, "data_offsets": [at, at + 4 * count]}
            values.extend(low + (high - low) * rng.random() for _ in range(count))
            at += 4 * count
    text = json.dumps(header).encode()
    pathlib.Path(path).write_bytes(struct.pack("<Q", len(text)) + text + values.tobytes())


class Evaluate(support.Case):
    def setUp(self):
        super().setUp()
        self.set = self.path("set")
        self.succeeds("dataset", "procedural", "--count", 3, "--solids", "--output", self.set, "--views", 11, "--size", self.SIDE, "--seed", 4)

    def evaluate(self, *more):
        return ("evaluate", self.set, "--model", self.model, *more)

    def test_json_is_as_agreed(self):
        out, _ = self.succeeds(*self.evaluate("--json"))
        result = json.loads(out)
        self.assertEqual(list(result), ["objects", "mean", "tuning", "precision", "switched_off"])
        self.assertEqual((result["tuning"], result["precision"], result["switched_off"]), (None, "fp32", None))
        self.assertEqual([o["name"] for o in result["objects"]], ["solid_0000", "solid_0001", "solid_0002"])
        for row in result["objects"]:
            self.assertEqual(list(row), ["name"] + NUMBERS)
            self.assertTrue(0 <= row["selected"] <= 1)
        self.assertEqual(list(result["mean"]), NUMBERS)
        for name in NUMBERS:
            self.assertAlmostEqual(result["mean"][name], sum(o[name] for o in result["objects"]) / 3, 9)
        self.assertEqual(out, self.succeeds(*self.evaluate("--json"))[0])

    def test_the_table_has_the_same_numbers(self):
        result = json.loads(self.succeeds(*self.evaluate("--json"))[0])
        out, err = self.succeeds(*self.evaluate())
        lines = [line.split() for line in out.splitlines()]
        self.assertEqual(lines[0], ["object", "PSNR", "coarse", "SSIM", "white", "nearest", "voxels", "%"])
        self.assertEqual([line[0] for line in lines[1:]], ["solid_0000", "solid_0001", "solid_0002", "mean"])
        for line, row in zip(lines[1:], result["objects"] + [result["mean"]]):
            for text, name in zip(line[1:], NUMBERS):
                self.assertAlmostEqual(float(text), row[name] * (100 if name == "selected" else 1), delta=0.006)
        self.assertIn("3 objects", err)

    def test_size(self):
        """Compared at another size: the score of white pictures shows which truth was used; the default and the model's own size agree."""
        usual = json.loads(self.succeeds(*self.evaluate("--json"))[0])
        self.assertEqual(usual, json.loads(self.succeeds(*self.evaluate("--size", self.SIDE, "--json"))[0]))
        larger = json.loads(self.succeeds(*self.evaluate("--size", 2 * self.SIDE, "--json"))[0])
        self.assertEqual(usual["mean"]["selected"], larger["mean"]["selected"])  # the inputs are the same
        self.assertNotEqual(usual["mean"]["psnr_white"], larger["mean"]["psnr_white"])
        self.refuses(2, "--size", *self.evaluate("--size", 5))

    def table(self, **fields):
        path = self.path("table.json")
        usual = {"systems": [{"name": "a|b", "model": self.model}, {"name": "c,d", "model": self.model}], "data": [{"name": "solids", "folders": [self.set]}],
                 "views": [{"name": "all"}, {"name": "one", "inputs": 1, "protocol": "random10", "seed": 3}]}
        pathlib.Path(path).write_text(json.dumps({k: v for k, v in {**usual, **fields}.items() if v is not None}))
        return "evaluate", "--table", path

    def test_small_pictures_have_several_samples(self):
        """A pixel of 11 is more than eight times as wide as one of 112, whatever the distance: eight samples along it, the maximum."""
        self.succeeds("init", "micro", "--seed", 3, "--set", "image=112", "--output", self.path("fine.safetensors"), "--quiet")
        def result(*more):
            return json.loads(self.succeeds("evaluate", self.set, "--model", self.path("fine.safetensors"), "--json", *more)[0])["objects"]
        auto = result("--size", 11)
        self.assertEqual(auto, result("--size", 11, "--supersample", 8))
        self.assertEqual(auto, result("--size", 11, "--supersample", "auto"))
        self.assertNotEqual(auto, result("--size", 11, "--supersample", 1))
        self.assertEqual(result(), result("--supersample", 1))
        self.refuses(2, ["--supersample", "1 to 8"], *self.evaluate("--supersample", 9))

    def test_rows_of_a_table(self):
        """Each equals the result of a separate evaluation."""
        files = [self.path(f"rows.{ending}") for ending in ("md", "csv", "json")]
        out, err = self.succeeds(*self.table(), *(word for path in files for word in ("--output", path)))
        self.assertIn("4 rows", err)
        self.assertEqual(open(files[0]).read(), out)
        lines = [line.split(" | ") for line in out.splitlines()]
        self.assertEqual([line[2] for line in lines[2:]], ["a\\|b", "c,d"] * 2)
        with open(files[1], newline="") as f:
            rows = list(csv.DictReader(f))
        result = json.load(open(files[2]))["rows"]
        self.assertEqual([row["system"] for row in rows], ["a|b", "c,d"] * 2)
        alone = {"all": (), "one": ("--view-count", 1, "--protocol", "random10", "--seed", 3)}
        for row, same in zip(rows, result, strict=True):
            mean = json.loads(self.succeeds(*self.evaluate(*alone[row["views"]], "--json"))[0])["mean"]
            self.assertEqual((same["psnr"], same["ssim"]), (mean["psnr"], mean["ssim"]))
            self.assertAlmostEqual(float(row["psnr"]), same["psnr"], delta=0.006)
            self.assertEqual((row["objects"], row["skipped"]), ("3", "0"))
            for number in ("seconds", "gaussians", "memory_mib"):
                self.assertGreaterEqual(same[number], 0)
            self.assertGreater(same["seconds"], 0)
        self.assertNotEqual(result[0]["psnr"], result[2]["psnr"])
        self.assertEqual(list(json.loads(self.succeeds(*self.table(views=None), "--json")[0])), ["rows"])

    def test_tables_that_cannot_be_made(self):
        for words, fields in ((["systems is missing"], {"systems": None}), (["data[0].folders", "list"], {"data": [{"name": "x", "folders": 3}]}),
                              (["sise", "size"], {"sise": 3}), (["size", "11 to 4096", "found 5"], {"size": 5}),
                              (["views[0].inputs", "found 0"], {"views": [{"name": "none", "inputs": 0}]}),
                              (["views", "protocol", "all"], {"views": [{"name": "x", "protocol": "all"}]}),
                              (["systems[0].name", "text"], {"systems": [{"name": ""}]}), (["nowhere"], {"data": [{"name": "x", "folders": ["nowhere"]}]})):
            with self.subTest(words=words):
                self.refuses(1, words, *self.table(**fields))
        self.refuses(2, ".md", *self.table(), "--output", self.path("table.txt"))
        self.refuses(2, "--table", "evaluate", "--output", self.path("table.md"))
        self.refuses(2, "--model", *self.table(), "--model", self.model)
        self.refuses(2, "--table", "evaluate")
        self.refuses(1, "is not a file", "evaluate", "--table", self.path("none.json"))

    def test_noise_on_poses(self):
        """The noise is the same for every model, and compared pictures do not move. A model that predicts rays reports their errors."""
        noise = ("--pose-noise", 0.02, "--pose-draws", 2, "--seed", 5, "--json")
        plain = json.loads(self.succeeds(*self.evaluate("--json"))[0])
        out, _ = self.succeeds(*self.evaluate(*noise))
        noisy = json.loads(out)
        self.assertEqual(list(noisy["mean"]), NUMBERS + ["pose_degrees", "pose_distance"])
        self.assertEqual(out, self.succeeds(*self.evaluate(*noise))[0])
        for a, b in zip(plain["objects"], noisy["objects"]):
            self.assertEqual((a["psnr_white"], a["psnr_nearest"]), (b["psnr_white"], b["psnr_nearest"]))
            self.assertNotEqual(a["psnr"], b["psnr"])
            self.assertTrue(0.05 < b["pose_degrees"] < 4 and 0 < b["pose_distance"] < 0.2, b)
        self.assertEqual(len({o["pose_degrees"] for o in noisy["objects"]}), 3)
        first = json.loads(self.succeeds(*self.evaluate(*noise[:2], *noise[4:]))[0])
        self.assertNotEqual(first["mean"]["pose_degrees"], noisy["mean"]["pose_degrees"])
        other = self.path("predicts.safetensors")
        self.succeeds("init", "micro", "--seed", 3, "--set", "poses=predicted", "--set", "share_ray_layers=1", "--set", "share_match_layers=2", "--output", other)
        result = json.loads(self.succeeds("evaluate", self.set, "--model", other, *noise)[0])
        self.assertEqual(list(result["mean"]), NUMBERS + ["pose_degrees", "pose_distance", "ray_degrees", "ray_moment"])
        for a, b in zip(noisy["objects"], result["objects"]):
            self.assertEqual((a["pose_degrees"], a["pose_distance"]), (b["pose_degrees"], b["pose_distance"]))
            self.assertGreater(b["ray_degrees"], 1)
        self.refuses(2, "--pose-noise", *self.evaluate("--pose-draws", 2))
        self.refuses(2, "--pose-noise", *self.evaluate("--pose-noise", 2))
        self.refuses(2, ["--refine", "--pose-noise"], *self.evaluate("--refine", "--pose-noise", 0.01))

    def test_refined(self):
        result, plain = (json.loads(self.succeeds(*self.evaluate("--size", 32, "--json", *more))[0]) for more in (["--refine"], []))
        for a, b in zip(result["objects"], plain["objects"]):
            self.assertNotEqual(a["psnr"], b["psnr"])
            for name in ("psnr_coarse", "psnr_white", "psnr_nearest", "selected"):
                self.assertEqual(a[name], b[name], name)
        # Random weights make fog; fitting clears it, also in pictures that it did not use.
        self.assertGreater(result["mean"]["psnr"], plain["mean"]["psnr"] + 0.5)

    def test_sheet(self):
        sheet = self.path("new", "sheet.png")
        self.succeeds(*self.evaluate("--sheet", sheet, "--json"))
        width, height, _ = support.read_png(sheet)
        self.assertEqual((width, height), (12 * (self.SIDE + 8) + 8, 4 * (self.SIDE + 12 + 8) + 8))
        self.refuses(1, "--overwrite", *self.evaluate("--sheet", sheet))

    def test_one_object_or_several_sets(self):
        one = json.loads(self.succeeds("evaluate", os.path.join(self.set, "solid_0001"), "--model", self.model, "--json")[0])
        two = json.loads(self.succeeds("evaluate", os.path.join(self.set, "solid_0001"), self.set, "--model", self.model, "--json")[0])
        self.assertEqual([o["name"] for o in two["objects"]], ["solid_0001", "solid_0000", "solid_0001_2", "solid_0002"])
        for name in NUMBERS:
            self.assertEqual(one["mean"][name], two["objects"][0][name])
            self.assertEqual(two["objects"][0][name], two["objects"][2][name])

    def test_random_views(self):
        result = [self.succeeds(*self.evaluate("--protocol", "random10", "--seed", seed, "--json"))[0] for seed in (1, 1)]
        self.assertEqual(*result)
        self.assertNotEqual(result[0], self.succeeds(*self.evaluate("--json"))[0])

    def test_the_cube_can_be_said(self):
        a, b = (json.loads(self.succeeds(*self.evaluate("--json", "--scale", scale))[0])["mean"] for scale in (1, 2))
        self.assertNotEqual(a["psnr"], b["psnr"])
        self.assertEqual(a["psnr_white"], b["psnr_white"])
        self.assertEqual(a, json.loads(self.succeeds(*self.evaluate("--json"))[0])["mean"])

    def test_bad_data(self):
        with open(os.path.join(self.set, "solid_0001", "images", "0005.png"), "r+b") as f:
            f.truncate(20)
        pathlib.Path(os.path.join(self.set, "solid_0002", "transforms.json")).write_text("{")
        out, err = self.succeeds(*self.evaluate("--skip-bad", "--json"))
        self.assertEqual([o["name"] for o in json.loads(out)["objects"]], ["solid_0000", "solid_0001"])
        for words in ("0005", "solid_0002", "2 objects, 1 left out"):
            self.assertIn(words, err)
        self.refuses(1, "solid_0002", "evaluate", os.path.join(self.set, "solid_0002"), "--model", self.model)

    def test_what_is_done_is_kept(self):
        whole = json.loads(self.succeeds(*self.evaluate("--json"))[0])
        pathlib.Path(os.path.join(self.set, "solid_0002", "transforms.json")).write_text("{")
        code, out, err = support.run(*self.evaluate("--json"))
        self.assertEqual(code, 1)
        self.assertIn("solid_0002", err)
        result = json.loads(out)
        self.assertEqual(list(result), ["objects", "mean", "stopped", "tuning", "precision", "switched_off"])
        self.assertEqual(result["objects"], whole["objects"][:2])
        self.assertIn("solid_0002", result["stopped"])
        for name in NUMBERS:
            self.assertAlmostEqual(result["mean"][name], sum(o[name] for o in result["objects"]) / 2, 9)
        code, out, err = support.run(*self.evaluate())
        self.assertEqual([line.split()[0] for line in out.splitlines()], ["object", "solid_0000", "solid_0001", "mean"])

    def test_frames_without_a_picture_are_passed_over(self):
        """Missing pictures are skipped as in reconstruct; a picture that exists and cannot be read is still an error."""
        listed = json.loads(pathlib.Path(os.path.join(self.set, "solid_0001", "transforms.json")).read_text())
        for name in ("0003", "0005"):
            os.remove(os.path.join(self.set, "solid_0001", "images", name + ".png"))
        out, err = self.succeeds(*self.evaluate("--json"))
        self.assertIn("object solid_0001: 2 of 11 listed frames have no picture and are skipped (images/0003.png first)", err)
        listed["frames"] = [f for f in listed["frames"] if "0003" not in f["file_path"] and "0005" not in f["file_path"]]
        pathlib.Path(os.path.join(self.set, "solid_0001", "transforms.json")).write_text(json.dumps(listed))
        self.assertEqual(self.succeeds(*self.evaluate("--json"))[0], out)

    def test_lpips(self):
        os.makedirs(self.path("weights"))
        write_alexnet(self.path("weights", "alex.safetensors"))
        self.refuses(2, ["31 pixels", "16"], *self.evaluate("--lpips", self.path("weights")))
        self.succeeds("init", "tiny", "--seed", 1, "--output", self.model, "--overwrite", "--quiet")
        result = json.loads(self.succeeds(*self.evaluate("--lpips", self.path("weights"), "--json"))[0])
        for row in result["objects"] + [result["mean"]]:
            self.assertEqual([name for name in row if name != "name"], NUMBERS + ["lpips_alex"])
            self.assertTrue(0.001 < row["lpips_alex"] < 1000)

    def test_wrong_requests(self):
        self.refuses(2, "--protocol", *self.evaluate("--protocol", "all"))
        self.refuses(2, "--seed", *self.evaluate("--seed", "x"))
        self.refuses(2, "--center", *self.evaluate("--center", "1,2"))
        self.refuses(1, "none", "evaluate", self.path("none"), "--model", self.model)
        os.makedirs(self.path("empty"))
        self.refuses(1, "no object", "evaluate", self.path("empty"), "--model", self.model)
        self.refuses(1, ["alex.safetensors", "vgg.safetensors"], *self.evaluate("--lpips", self.path("empty")))


if __name__ == "__main__":
    support.main()
