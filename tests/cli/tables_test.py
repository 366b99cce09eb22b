"""The tables in examples/tables: each is planned and evaluated, with small models and data sets of the named layouts."""
import json
import math
import os
import shutil
import sys

import support
from evaluate_test import write_alexnet

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
TABLES = os.path.join(ROOT, "examples", "tables")
sys.path.insert(0, os.path.join(ROOT, "tests", "hostile"))
import hdf5_files

PREDICTED = ("--set", "poses=predicted", "--set", "share_ray_layers=1", "--set", "share_match_layers=2")
MODELS = {
    "vsplat": ("micro",),
    "vsplat-predicted": ("micro", *PREDICTED),
    "lara": ("micro", "--system", "lara"),
    "genden": ("micro", "--system", "genden"),
    "vsplat-genden": ("tiny", "--system", "vsplat+genden"),
    "vsplat-genden-predicted": ("tiny", "--system", "vsplat+genden", *PREDICTED),
}


class Tables(support.Case):
    def hdf5(self, *place, views=11):
        os.makedirs(self.path(*place[:-1]), exist_ok=True)
        file = hdf5_files.File(self.path(*place))
        group = file.group("object")
        for i in range(views):
            file.view(group, i)
        file.H("H5Gclose", group)
        file.close()

    def gso(self, name, views=11):
        """In the layout of LaRa's authors: intrinsics for pictures of 512 x 512, pictures found by their numbers."""
        os.makedirs(self.path("gso", name))
        frames = []
        for i in range(views):
            rows = [[((x * 13 + 40 * i) % 256, (y * 17) % 256, 90) for x in range(self.SIDE)] for y in range(self.SIDE)]
            support.write_png(self.path("gso", name, f"r_{i:03}.png"), self.SIDE, self.SIDE, rows)
            frames.append({"file_path": "elsewhere", "transform_matrix": support.camera_to_world(360 / views * i),
                           "intrinsic_matrix": [[560, 0, 256], [0, 560, 256], [0, 0, 1]]})
        json.dump({"frames": frames}, open(self.path("gso", name, "transforms.json"), "w"))

    def setUp(self):
        super().setUp()
        os.mkdir(self.path("models"))
        for name, options in MODELS.items():
            self.succeeds("init", *options, "--seed", 5, "--output", self.path("models", name + ".safetensors"))
        self.hdf5("gobjaverse", "part", "first.h5")
        self.hdf5("co3d", "hydrant", "test.h5")
        self.hdf5("co3d", "teddybear", "test.h5")
        self.gso("cup")
        os.mkdir(self.path("lpips"))
        write_alexnet(self.path("lpips", "alex.safetensors"))

    def test_each_is_planned_and_made(self):
        names = sorted(os.listdir(TABLES))
        self.assertEqual(names, ["co3d.json", "gobjaverse.json", "gso.json"])
        used = set()
        for name in names:
            with self.subTest(name=name):
                path = self.path(name)
                shutil.copy(os.path.join(TABLES, name), path)
                table = json.load(open(path))
                used |= {os.path.basename(system["model"])[:-len(".safetensors")] for system in table["systems"]}
                rows = math.prod(len(table[part]) for part in ("systems", "data", "views"))
                plans = json.loads(self.succeeds("evaluate", "--table", path, "--dry-run", "--json")[0])
                self.assertEqual(len(plans), rows)
                for plan in plans:
                    self.assertIn(f" on {table['data'][0]['name']}, ", plan["what"])
                    self.assertIn("2 objects" if name == "co3d.json" else "1 object", plan["what"])
                    self.assertGreater(plan["peak_bytes"], 0)
                self.assertEqual((table["size"], table["lpips"]), (512, "lpips"))
                json.dump({**table, "size": 64}, open(path, "w"))  # the minimum for LPIPS
                result = json.loads(self.succeeds("evaluate", "--table", path, "--json")[0])["rows"]
                self.assertEqual([(row["views"], row["system"]) for row in result], [(v["name"], s["name"]) for v in table["views"] for s in table["systems"]])
                for row in result:
                    self.assertEqual((row["objects"], row["skipped"]), (2 if name == "co3d.json" else 1, 0))
                    self.assertIsInstance(row["lpips_alex"], float)
        self.assertEqual(used, set(MODELS))

    def test_a_dry_run_finds_what_is_missing(self):
        path = self.path("gso.json")
        shutil.copy(os.path.join(TABLES, "gso.json"), path)
        dry = ("evaluate", "--table", path, "--dry-run")
        self.assertIn("GSO, ten at random: 1 object", self.succeeds(*dry)[0])
        self.refuses(2, ["--dry-run", "--output"], *dry, "--output", self.path("table.md"))
        self.refuses(2, "--profile", *dry, "--profile", self.path("p.json"))
        self.refuses(2, "--table", "evaluate", self.path("gso"), "--dry-run")
        table = json.load(open(path))
        for words, change in ((["LaRa on GSO, many", "16"], {"views": [{"name": "many", "inputs": 16}]}), ("nowhere", {"lpips": "nowhere"}),
                              ("none.safetensors", {"systems": [{"name": "none", "model": "none.safetensors"}]}), ("nothing", {"data": [{"name": "x", "folders": ["nothing"]}]})):
            with self.subTest(words=words):
                json.dump({**table, **change}, open(path, "w"))
                self.refuses(1 if "views" not in change else 2, words, *dry)


if __name__ == "__main__":
    support.main()
