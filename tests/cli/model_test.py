"""The default model, with a library that contains a built-in one and with a library that does not; and conversion."""
import json
import os
import pathlib
import re

import support

# The built-in model of one library, and the folders of both.
MICRO, WITH, WITHOUT = (os.environ[name] for name in ("VSPLAT_MICRO", "VSPLAT_WITH_MODEL", "VSPLAT_WITHOUT_MODEL"))


def library(folder):
    return {"LD_LIBRARY_PATH": ":".join(filter(None, [folder, os.environ.get("LD_LIBRARY_PATH")]))}


class Model(support.Case):
    def read(self, name):
        return pathlib.Path(self.path(name)).read_bytes()

    def info(self, *model, env=None):
        return json.loads(self.succeeds("weights", "info", *model, "--json", env=env)[0])

    def test_the_built_in_model_is_taken(self):
        self.assertEqual(self.read("model.safetensors"), pathlib.Path(MICRO).read_bytes())
        self.succeeds(*self.reconstruct())
        self.succeeds("reconstruct", self.views, "--output", self.path("own.ply"), env=library(WITH))
        self.assertEqual(self.read("out.ply"), self.read("own.ply"))
        out, _ = self.succeeds("reconstruct", self.views, "--dry-run", "--json", env=library(WITH))
        def needed(text):  # the available memory depends on what else runs
            return [{key: value for key, value in plan.items() if "limit" not in key} for plan in json.loads(text)]
        self.assertEqual(needed(out), needed(self.succeeds(*self.reconstruct("--dry-run", "--json"))[0]))

    def test_evaluate_takes_it_too(self):
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("set"), "--views", 11, "--size", self.SIDE)
        out, _ = self.succeeds("evaluate", self.path("set"), "--json", env=library(WITH))
        self.assertEqual(out, self.succeeds("evaluate", self.path("set"), "--model", self.model, "--json")[0])
        self.refuses(1, ["without a model", "--model"], "evaluate", self.path("set"), env=library(WITHOUT))

    def test_a_named_model_goes_before_it(self):
        self.succeeds("init", "micro", "--seed", 4, "--output", self.path("other.safetensors"))
        named = ("reconstruct", self.views, "--model", self.path("other.safetensors"))
        self.succeeds(*named, "--output", self.path("a.ply"))
        self.succeeds(*named, "--output", self.path("b.ply"), env=library(WITH))
        self.succeeds("reconstruct", self.views, "--output", self.path("own.ply"), env=library(WITH))
        self.assertEqual(self.read("a.ply"), self.read("b.ply"))
        self.assertNotEqual(self.read("a.ply"), self.read("own.ply"))

    def test_the_built_in_model_is_shown(self):
        self.assertEqual(self.info(env=library(WITH)), self.info(self.model))
        out, _ = self.succeeds("weights", "info", env=library(WITH))
        self.assertTrue(out.startswith(f"built-in model: {os.path.getsize(MICRO)} bytes\n"), out)
        out, _ = self.succeeds("weights", "verify", "--json", env=library(WITH))
        self.assertEqual(json.loads(out), {"model": "built-in model", "structure": "ok", "hash": "ok"})

    def test_without_one_a_model_must_be_named(self):
        words = ["without a model", "--model"]
        for command in (("reconstruct", self.views, "--output", self.path("x.ply")), ("reconstruct", self.views, "--dry-run"),
                        ("weights", "info"), ("weights", "verify"),
                        ("weights", "convert", "--dtype", "f16", "--output", self.path("x.safetensors"))):
            self.refuses(1, words, *command, env=library(WITHOUT))
        self.succeeds(*self.reconstruct(), env=library(WITHOUT))

    def test_halves_and_back(self):
        half, whole, again = (self.path(name) for name in ("half", "whole", "again"))
        out, _ = self.succeeds("weights", "convert", self.model, "--dtype", "f16", "--output", half, "--json")
        self.assertEqual(json.loads(out), {"output": half, "dtype": "f16", "bytes": os.path.getsize(half)})
        self.assertEqual(list(self.info(half)["dtypes"]), ["F16"])
        self.assertEqual(self.info(half)["config"], self.info(self.model)["config"])
        self.assertEqual(self.info(half)["provenance"], self.info(self.model)["provenance"])
        tensors = 2 * self.info(self.model)["parameters"]                # at least: buffers come in addition
        self.assertLessEqual(tensors, os.path.getsize(self.model) - os.path.getsize(half))
        self.succeeds("weights", "convert", half, "--dtype", "f32", "--output", whole)
        self.assertEqual(list(self.info(whole)["dtypes"]), ["F32"])
        self.succeeds("weights", "convert", whole, "--dtype", "f16", "--output", again)
        self.assertEqual(self.read("half"), self.read("again"))
        for model, scene in ((half, "half.ply"), (whole, "whole.ply")):
            self.succeeds("reconstruct", self.views, "--model", model, "--output", self.path(scene))
        self.assertEqual(self.read("half.ply"), self.read("whole.ply"))
        self.refuses(1, "exists", "weights", "convert", self.model, "--dtype", "f16", "--output", half)

    def test_how_many_views_a_model_takes_is_its_own(self):
        many = self.make_views("many", count=20)

        def views(*more):
            out, err = self.succeeds("reconstruct", many, "--output", self.path("x.ply"), "--overwrite", "--json", *more)
            return json.loads(out)["views"], err

        def result(*more):
            return json.loads(self.succeeds("reconstruct", many, "--dry-run", "--json", *more)[0])[0]["what"]

        used, err = views("--model", self.model)
        self.assertEqual(used, 2)                                        # a file that states nothing: as in training
        self.assertIn("2 of 20 pictures used; --view-count 16 uses more", err)
        own = self.path("own.safetensors")
        self.succeeds("weights", "convert", self.model, "--dtype", "f32", "--view-count", 7, "--output", own)
        self.assertEqual(self.info(own)["config"], {**self.info(self.model)["config"], "use_views": 7})
        used, err = views("--model", own)
        self.assertEqual(used, 7)
        self.assertIn("7 of 20 pictures used; --view-count 16 uses more", err)
        self.assertIn("7 views", result("--model", own))
        self.assertNotIn("warning", self.succeeds("reconstruct", self.views, "--model", own, "--output", self.path("few.ply"))[1])
        used, err = views("--model", own, "--view-count", 16)
        self.assertEqual(used, 16)
        self.assertIn("16 of 20 pictures used, as many as the network takes", err)
        self.assertIn("3 views", result("--model", own, "--view-count", 3))
        _, err = views("--model", own, "--views", "@0,@1")               # named views need no default number
        self.assertNotIn("pictures used", err)
        # The published protocol has its own number of views.
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("set"), "--views", 11, "--size", self.SIDE)
        evaluations = [self.succeeds("evaluate", self.path("set"), "--model", model, "--json")[0] for model in (self.model, own)]
        self.assertEqual(*evaluations)
        self.succeeds("weights", "convert", own, "--dtype", "f32", "--output", self.path("kept.safetensors"))
        self.assertEqual(self.info(self.path("kept.safetensors"))["config"]["use_views"], 7)

    def test_how_many_passes_a_model_takes_is_its_own(self):
        own = self.path("own.safetensors")
        self.succeeds("weights", "convert", self.model, "--dtype", "f32", "--passes", 2, "--merge-cell", 0.5, "--output", own)
        self.assertEqual(self.info(own)["config"], {**self.info(self.model)["config"], "passes": 2, "merge_cell": 0.5})
        kept = self.path("kept.safetensors")
        self.succeeds("weights", "convert", own, "--dtype", "f32", "--merge-cell", 1, "--output", kept)
        self.assertEqual(self.info(kept)["config"], {**self.info(own)["config"], "merge_cell": 1.0})

        def made(model, *more):
            out, err = self.succeeds("reconstruct", self.views, "--model", model, "--output", self.path("x.ply"), "--overwrite", "--json", *more)
            return json.loads(out), err

        (one, err), (two, says) = made(self.model), made(own)
        self.assertEqual((one["passes"], two["passes"]), (1, 2))
        self.assertRegex(err, r"Gaussians from \d+ selected voxels")
        self.assertRegex(says, r"Gaussians from 2 passes \(\d+ voxels selected in the first\)")
        self.assertLess(two["gaussians"], one["gaussians"])
        self.assertEqual(made(own, "--passes", 1, "--merge-cell", "none")[0]["gaussians"], one["gaussians"])
        self.assertEqual(made(self.model, "--passes", 16)[0]["passes"], one["views"])
        self.assertEqual(made(own, "--dump", self.path("stages"))[0]["passes"], 1)
        self.assertEqual(made(own, "--dump", self.path("stages"))[0]["fit_epochs"], 0)
        for wrong in ("0", "17", "-1", "2.5", "all"):
            self.refuses(2, "--passes", *self.reconstruct("--passes", wrong))
        for wrong in ("0", "-1", "17", "nan", "all"):
            self.refuses(2, "--merge-cell", *self.reconstruct("--merge-cell", wrong))
        self.succeeds("reconstruct", self.views, "--model", self.model, "--output", self.path("y.ply"), "--write-selection", self.path("s.txt"))
        self.refuses(2, ["--passes", "2"], *self.reconstruct("--passes", 2, "--selection", self.path("s.txt")))
        self.refuses(2, ["--passes", "2"], *self.reconstruct("--passes", 2, "--dump", self.path("d")))

    def test_how_long_a_model_fits_its_result_is_its_own(self):
        own = self.path("own.safetensors")
        self.succeeds("weights", "convert", self.model, "--dtype", "f32", "--fit-epochs", 3, "--output", own)
        self.assertEqual(self.info(own)["config"], {**self.info(self.model)["config"], "fit_epochs": 3})

        def made(model, *more):
            out, err = self.succeeds("reconstruct", self.views, "--model", model, "--output", self.path("x.ply"), "--overwrite", "--json", *more)
            return json.loads(out)["fit_epochs"], err, self.read("x.ply")

        without, own_ones = made(self.model), made(own)
        self.assertEqual((without[0], own_ones[0]), (0, 3))
        self.assertNotIn("epochs", without[1])
        self.assertRegex(own_ones[1], r"selected voxels, fitted to the pictures in 3 epochs")
        self.assertNotEqual(own_ones[2], without[2])
        self.assertEqual(made(own, "--fit-epochs", 0)[2], without[2])
        self.assertEqual(made(self.model, "--fit-epochs", 3)[2], own_ones[2])
        self.assertEqual(made(own, "--dump", self.path("stages"))[2], without[2])
        for wrong in ("-1", "1001", "2.5", "none"):
            self.refuses(2, "--fit-epochs", *self.reconstruct("--fit-epochs", wrong))
        self.refuses(2, ["--fit-epochs", "2"], *self.reconstruct("--fit-epochs", 2, "--dump", self.path("d")))
        lara = self.path("lara.safetensors")
        self.succeeds("init", "tiny", "--system", "lara", "--seed", 3, "--output", lara)
        self.refuses(2, ["--fit-epochs", "surfels"], "reconstruct", self.views, "--model", lara, "--output", self.path("l.ply"), "--fit-epochs", 2)

    def test_view_counts_that_cannot_be(self):
        for count in ("0", "17", "-1", "4.5", "all"):
            self.refuses(2, "--view-count", *self.reconstruct("--view-count", count))
            self.refuses(2, "--view-count", "weights", "convert", self.model, "--dtype", "f16", "--output", self.path("x"), "--view-count", count)
        self.refuses(2, ["--view-count", "--views"], *self.reconstruct("--view-count", 2, "--views", "@0"))
        _, err = self.succeeds(*self.reconstruct("--view-count", 5))
        self.assertIn("warning", err)                                    # requested, but not available

    def test_the_built_in_model_as_a_file(self):
        self.succeeds("weights", "convert", "--dtype", "f32", "--output", self.path("own.safetensors"), env=library(WITH))
        self.assertEqual(self.read("own.safetensors"), self.read("model.safetensors"))

    def test_the_bundled_pictures_are_read(self):
        data = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "examples", "data")
        for name in ("garden_gnome", "painted_skull"):
            out, _ = self.succeeds("reconstruct", os.path.join(data, name), "--output", self.path(name + ".ply"), "--json", env=library(WITH))
            self.assertEqual(json.loads(out)["views"], 2)                # as many as micro accepts, of four

    def test_the_example_of_the_help_finds_the_skull(self):
        skull = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "examples", "data", "painted_skull")
        result = re.search(r"--views (\S+) --center (\S+) --scale (\S+)", self.succeeds("reconstruct", "--help")[0])
        _, err = self.succeeds("reconstruct", skull, "--model", self.model, "--output", self.path("x.ply"), "--views", result.group(1), "--center",
                               result.group(2), "--scale", result.group(3))
        self.assertNotIn("is behind", err)


if __name__ == "__main__":
    support.main()
