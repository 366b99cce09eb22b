"""vsplat weights import: PyTorch's checkpoints become models to the bit. Damaged and malicious ones are refused: nothing in them is run,
and nothing is written."""
import json
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile

import support

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.path.insert(0, os.path.join(ROOT, "tests", "hostile"))
import checkpoints  # noqa: E402
MAKER = os.path.join(ROOT, "tests", "reference", "pytorch", "run.sh")
MUTATIONS = 300
ALL = bool(os.environ.get("VSPLAT_MUTATIONS"))  # otherwise some of them


def tensors(path):
    """Returns {name: (shape, bytes)} of a safetensors file."""
    data = pathlib.Path(path).read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    return {name: (entry["shape"], data[8 + size + entry["data_offsets"][0]:8 + size + entry["data_offsets"][1]])
            for name, entry in header.items() if name != "__metadata__"}


class Checkpoints(support.Case):
    """Models with PyTorch's files beside each, which are made once: starting PyTorch takes seconds."""
    made = None  # the folder, or the reason why there are none

    def setUp(self):
        super().setUp()
        # Imported like the weights of the published code.
        self.succeeds("init", "micro", "--seed", 3, "--set", "negate_camera_centre=true", "--output", self.model, "--overwrite")
        self.other = self.path("other.safetensors")
        self.succeeds("init", "micro", "--seed", 4, "--set", "fine_count=3", "--set", "volume_ch=8", "--set", "negate_camera_centre=true", "--output", self.other)
        if not Checkpoints.made:
            Checkpoints.made = tempfile.TemporaryDirectory(prefix="vsplat-cli-")
            done = subprocess.run([MAKER, "make_checkpoints.py", self.made.name, self.model, self.other], capture_output=True, text=True, timeout=280)
            if done.returncode == 77:
                Checkpoints.made = done.stderr
            else:
                self.assertEqual(done.returncode, 0, done.stderr)
        if isinstance(self.made, str):
            self.skipTest(self.made)
        shutil.copytree(self.made.name, self.folder, dirs_exist_ok=True)

    def imports(self, name, *more):
        """Returns the JSON and stderr."""
        out, err = self.succeeds("weights", "import", self.path(name), "--output", self.path("got.safetensors"), "--overwrite", "--json", *more)
        return json.loads(out), err


class Import(Checkpoints):
    def refused(self, words, name, *more, code=1):
        """Writes nothing, and the error is safe for a terminal."""
        err = self.refuses(code, words, "weights", "import", self.path(name), "--output", self.path("none.safetensors"), *more)
        self.assertFalse(any(ord(c) < 32 and c != "\n" for c in err), repr(err))
        return err

    def info(self, path):
        return json.loads(self.succeeds("weights", "info", path, "--json")[0])

    def test_the_same_to_the_bit(self):
        scenes = set()
        for name in ("lightning.ckpt", "bare.pth", "wrapped.pth", "parallel.ckpt", "compiled.ckpt", "strided.ckpt", "more.ckpt"):
            with self.subTest(name=name):
                result, _ = self.imports(name)
                self.assertEqual(result["named"], "micro")
                self.assertEqual(result["config"], self.info(self.model)["config"])
                self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.model))
                self.assertIn("imported", self.info(self.path("got.safetensors"))["provenance"]["origin"])
                self.succeeds("weights", "verify", self.path("got.safetensors"))
                self.succeeds("reconstruct", self.views, "--model", self.path("got.safetensors"), "--output", self.path("got.ply"), "--overwrite")
                scenes.add(pathlib.Path(self.path("got.ply")).read_bytes())
        self.succeeds(*self.reconstruct())
        self.assertEqual(scenes, {pathlib.Path(self.path("out.ply")).read_bytes()})

    def test_values_of_other_types(self):
        for name in ("half", "bfloat"):
            self.imports(name + ".ckpt")
            got = b"".join(data for _, data in tensors(self.path("got.safetensors")).values())
            self.assertEqual(got, pathlib.Path(self.path(name + ".raw")).read_bytes(), name)
        self.imports("double.ckpt")
        self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.model))  # doubles whose values floats hold exactly

    def test_what_was_left_out_is_listed(self):
        result, err = self.imports("more.ckpt")
        self.assertEqual(result["left_out"], ["loss.lpips.weight", "net.encoder.model.head.weight", "net.centers", "epoch", "global_step", "pytorch-lightning_version",
                                            "loops", "callbacks", "optimizer_states", "lr_schedulers"])
        for name in result["left_out"]:
            self.assertIn(f"left out: {name}\n", err)
        self.assertIn(f"vsplat weights check {self.path('got.safetensors')}", err)
        self.assertEqual(self.imports("bare.pth")[0]["left_out"], [])

    def test_what_shapes_do_not_tell(self):
        self.refused(["vit_heads, groups, image, volume", "--set", "--config"], "other.ckpt", code=2)
        fields = {"vit_heads": 2, "groups": 2, "image": 16, "volume": 4}
        for left in fields:
            given = [word for name, value in fields.items() if name != left for word in ("--set", f"{name}={value}")]
            err = self.refused(f"do not determine {left}:", "other.ckpt", *given, code=2)
            self.assertNotIn("vsplat_", err)
        json.dump({**fields, "views": 2, "image": 24}, open(self.path("fields.json"), "w"))
        result, _ = self.imports("other.ckpt", "--config", self.path("fields.json"), "--set", "image=16")
        self.assertIsNone(result["named"])
        self.assertEqual(result["config"], self.info(self.other)["config"])
        self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.other))
        # Fields of a named configuration can be changed unless shapes determine them.
        result, _ = self.imports("lightning.ckpt", "--set", "image=24", "--set", "negate_camera_centre=false")
        self.assertEqual(result["config"], {**self.info(self.model)["config"], "image": 24, "negate_camera_centre": False})
        self.refused(["fine_count", "2", "5"], "lightning.ckpt", "--set", "fine_count=5", code=2)
        self.refused("imaeg", "lightning.ckpt", "--set", "imaeg=5", code=2)
        self.refused("image must be a multiple of patch", "lightning.ckpt", "--set", "image=17", code=2)
        json.dump({"imaeg": 3}, open(self.path("fields.json"), "w"))
        self.refused(["fields.json", "imaeg"], "lightning.ckpt", "--config", self.path("fields.json"))
        self.refused("nowhere.json", "lightning.ckpt", "--config", self.path("nowhere.json"))

    def test_tensors_that_do_not_fit(self):
        name = "net.dir_norm.mlp.0.weight"
        self.refused(["1 of", "missing", "dir_norm.mlp.0.weight"], "missing.ckpt")
        self.refused([name, "[32, 12]", "[12, 32]"], "misshapen.ckpt")
        self.refused("several values share parts of it", "repeated.ckpt")
        self.refused([name, "I64", "F32"], "whole.ckpt")
        self.refused([name, "nan"], "nan.ckpt")
        self.refused(["missing", "dir_norm.mlp.0.weight"], "text.ckpt")
        self.refused(["net.predictor.third.weight"], "extra.ckpt")
        self.refused(["torch._utils _rebuild_sparse_tensor"], "sparse.ckpt")
        self.refused(["torch ComplexFloatStorage"], "complex.ckpt")

    def test_other_files_are_reported_by_name(self):
        for words, name in (("LaRa", "lara.ckpt"), ("GenDen's network", "genden.ckpt"), ("with GenDen's densifier", "densified.ckpt"), ("Plücker", "share.ckpt"),
                            (["DINOv3", "Hugging Face"], "dinov3.pth"), ("no dict", "list.pth"), ("no tensors", "empty.pth"),
                            (["before PyTorch 1.6", "save it again"], "old.pth"), (["protocol 4", "expected 2"], "protocol.pth"),
                            ("torch.nn.modules.linear Linear", "module.pth"), ("compressed", "script.pt"), ("not a zip archive", "model.safetensors")):
            with self.subTest(name=name):
                self.refused(words, name)
        open(self.path("nothing.ckpt"), "w").close()
        self.refused("nothing.ckpt", "nothing.ckpt")
        self.refused("nowhere.ckpt", "nowhere.ckpt")
        os.mkfifo(self.path("pipe.ckpt"))
        self.refused("no regular file", "pipe.ckpt")
        self.refused("folder", "views")

    def test_files_that_exist_stay(self):
        open(self.path("mine.safetensors"), "w").write("mine")
        self.refuses(1, ["exists", "--overwrite"], "weights", "import", self.path("bare.pth"), "--output", self.path("mine.safetensors"))
        self.refuses(2, "bare.pth is read", "weights", "import", self.path("bare.pth"), "--output", self.path("bare.pth"), "--overwrite")

    def test_an_encoder(self):
        made = [self.path(f"{name}.safetensors") for name in ("by_model", "by_dino", "by_teacher", "by_whole")]
        for encoder, out in zip(("model.safetensors", "dino.pth", "dino_teacher.pth", "lightning.ckpt"), made):
            self.succeeds("init", "micro", "--seed", 9, "--encoder", self.path(encoder), "--output", out)
        self.assertEqual(len({pathlib.Path(path).read_bytes() for path in made}), 1)
        for words, name in (("register_tokens", "dinov3.pth"), ("cls_token", "lara.ckpt"), ("protocol 4", "protocol.pth")):
            self.refuses(1, words, "init", "micro", "--seed", 9, "--encoder", self.path(name), "--output", self.path("none.safetensors"))

    @support.slow
    def test_an_encoder_becomes_a_model_about_it(self):
        """In the quick tests: test_an_encoder, and Dinov3, whose checkpoint becomes a model."""
        result, err = self.imports("dino.pth")
        self.assertEqual((result["named"], result["encoder_alone"], result["left_out"]), ("micro", True, []))
        self.assertIn("vsplat train --init", err)
        self.succeeds("init", "micro", "--seed", 0, "--encoder", self.path("dino.pth"), "--output", self.path("made.safetensors"))
        self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.path("made.safetensors")))
        self.assertIn("random", self.info(self.path("got.safetensors"))["provenance"]["origin"])


class Dinov3(support.Case):
    """The encoder in Meta's naming; the file is committed, so PyTorch is not needed."""
    CHECKPOINT = os.path.join(ROOT, "tests", "golden", "dinov3_micro_meta.pth")
    FIELDS = [word for field in ("vit_heads=2", "groups=2", "image=16", "volume=4", "volume_ch=4", "voxel_ch=8", "fine_dim=8", "views=2") for word in ("--set", field)]

    def test_becomes_a_model_that_reconstructs(self):
        self.refuses(2, "do not determine vit_heads, groups, image, volume:", "weights", "import", self.CHECKPOINT, "--output", self.path("none.safetensors"))
        made = self.path("dinov3.safetensors")
        result = json.loads(self.succeeds("weights", "import", self.CHECKPOINT, "--output", made, "--json", *self.FIELDS)[0])
        self.assertEqual((result["config"]["encoder"], result["config"]["vit_registers"], result["encoder_alone"]), ("dinov3", 2, True))
        self.assertEqual(sorted(result["left_out"]), ["blocks.0.attn.qkv.bias", "blocks.0.attn.qkv.bias_mask", "mask_token", "rope_embed.periods"])
        self.succeeds("weights", "verify", made)
        self.succeeds("reconstruct", self.views, "--model", made, "--output", self.path("got.ply"))
        fields = [word for field in ("encoder=dinov3", "vit_registers=2", "vit_dim=16") for word in ("--set", field)]
        self.succeeds("init", "micro", "--seed", 1, *fields, "--encoder", self.CHECKPOINT, "--output", self.path("init.safetensors"))
        self.assertEqual(tensors(self.path("init.safetensors"))["encoder.model.reg_token"], tensors(made)["encoder.model.reg_token"])


class Lara(support.Case):
    """LaRa's checkpoint is committed, so PyTorch is not needed."""
    CHECKPOINT = os.path.join(ROOT, "tests", "golden", "lara_micro.ckpt")

    def test_becomes_a_model(self):
        made = self.path("lara.safetensors")
        result = json.loads(self.succeeds("weights", "import", self.CHECKPOINT, "--output", made, "--json")[0])
        self.assertEqual((result["system"], result["named"], result["parameters"]), ("lara", "micro", 9390))
        self.assertIn("net.group_centers", result["left_out"])
        info = json.loads(self.succeeds("weights", "info", made, "--json")[0])
        self.assertEqual((info["system"], info["config"]), ("lara", result["config"]))
        self.assertIn("lara", self.succeeds("weights", "info", made)[0])
        self.succeeds("weights", "verify", made)
        self.succeeds("weights", "convert", made, "--dtype", "f16", "--output", self.path("half.safetensors"))
        self.assertEqual(json.loads(self.succeeds("weights", "info", self.path("half.safetensors"), "--json")[0])["system"], "lara")
        self.refuses(2, ["LaRa's network", "VS-Splat's"], "weights", "convert", made, "--dtype", "f32", "--view-count", 3, "--output", self.path("more.safetensors"))

    def test_reconstructs(self):
        made, scene = self.path("lara.safetensors"), self.path("scene.ply")
        self.succeeds("weights", "import", self.CHECKPOINT, "--output", made)
        self.succeeds("reconstruct", self.views, "--model", made, "--center", "0,0,0", "--scale", 1, "--output", scene)
        header = pathlib.Path(scene).read_bytes().split(b"end_header")[0].decode()
        self.assertIn("property float scale_1", header)
        self.assertNotIn("property float scale_2", header)  # surfels
        self.assertNotIn("element vertex 0", header)
        self.succeeds("reconstruct", self.views, "--model", made, "--dry-run")
        many = self.make_views("many", count=5)
        self.refuses(2, ["5 views", "1 to 3", "view_slots"], "reconstruct", many, "--model", made, "--view-count", 5, "--output", self.path("none.ply"))
        self.refuses(2, "selects no voxels", "reconstruct", self.views, "--model", made, "--selection-seed", 1, "--output", self.path("none.ply"))
        self.refuses(2, ["LaRa's network", "VS-Splat's"], "fit", self.views, "--model", made, "--start", "network", "--steps", 1, "--output", self.path("none.ply"))

    def test_what_is_another_networks_is_refused(self):
        self.refuses(2, ["view_slots", "3", "4"], "weights", "import", self.CHECKPOINT, "--set", "view_slots=4", "--output", self.path("none.safetensors"))
        self.refuses(2, "volume_mult", "weights", "import", self.CHECKPOINT, "--set", "volume_mult=1", "--output", self.path("none.safetensors"))


class Genden(support.Case):
    """GenDen's checkpoint is committed, too."""
    CHECKPOINT = os.path.join(ROOT, "tests", "golden", "genden_micro.ckpt")

    def test_becomes_a_model_and_reconstructs(self):
        made, scenes = self.path("genden.safetensors"), [self.path(f"{name}.ply") for name in ("first", "again", "other")]
        result = json.loads(self.succeeds("weights", "import", self.CHECKPOINT, "--output", made, "--json")[0])
        self.assertEqual((result["system"], result["named"], result["parameters"]), ("genden", "micro", 21208))
        self.assertEqual(result["config"]["densify.top_k"], 9)
        self.succeeds("weights", "verify", made)
        for scene, seed in zip(scenes, (0, 0, 4)):
            self.succeeds("reconstruct", self.views, "--model", made, "--center", "0,0,0", "--scale", 1, "--selection-seed", seed, "--output", scene)
        first, again, other = (pathlib.Path(scene).read_bytes() for scene in scenes)
        self.assertIn(b"property float scale_2", first)
        self.assertEqual(first, again)
        self.assertNotEqual(first, other)  # the curves in another order
        self.assertIn("densify", self.succeeds("reconstruct", self.views, "--model", made, "--dry-run")[0])
        residual = self.path("residual.safetensors")
        self.succeeds("weights", "import", self.CHECKPOINT, "--set", "densify.residual=true", "--output", residual)
        self.assertTrue(json.loads(self.succeeds("weights", "info", residual, "--json")[0])["config"]["densify.residual"])

    def test_a_configuration_is_dotted_or_nested(self):
        """--config: fields with dotted names, nested objects, the output of `weights info --json`, and a model file's metadata."""
        def imported(config):
            pathlib.Path(self.path("config.json")).write_text(json.dumps(config))
            self.succeeds("weights", "import", self.CHECKPOINT, "--config", self.path("config.json"), "--output", self.path("made.safetensors"), "--overwrite")
            return json.loads(self.succeeds("weights", "info", self.path("made.safetensors"), "--json")[0])
        dotted = imported({"densify.residual": True, "densify.non_leaf_ratio": 0.7})
        self.assertEqual((dotted["config"]["densify.residual"], dotted["config"]["densify.non_leaf_ratio"]), (True, 0.7))
        for config in ({"densify": {"residual": True, "non_leaf_ratio": 0.7}}, dotted, {"system": "genden", "config": json.dumps(dotted["config"])}):
            self.assertEqual(imported(config)["config"], dotted["config"])
        for config, said in (({"densify": {"residul": True}}, "densify.residul"), ({"densify": {"residual": True}, "densify.residual": True}, "twice"),
                             ({"densify": 3}, "densify"), ({"imagee": {}}, "imagee"), ({"config": 3}, "not a JSON object")):
            pathlib.Path(self.path("config.json")).write_text(json.dumps(config))
            self.refuses(1, ["config.json", said], "weights", "import", self.CHECKPOINT, "--config", self.path("config.json"), "--output", self.path("none.safetensors"))


class Mutations:
    """300 damaged or malicious files, made from a sound one: some of them, with VSPLAT_MUTATIONS all."""
    def begin(self, sound, *more):
        """more: the options that importing the sound file needs."""
        self.random, self.more = random.Random(7), more
        self.broken = checkpoints.Broken(sound, self.path("canary"), self.random)
        self.succeeds("weights", "import", sound, "--output", self.path("right.safetensors"), *more)
        self.right = pathlib.Path(self.path("right.safetensors")).read_bytes()

    def test_mutations(self):
        made = list(self.broken.certain())
        made += [(f"cut {i}", self.broken.cut()) for i in range(60)]
        certain = len(made)
        made += [(f"bits {i}", self.broken.spoilt()) for i in range(certain, MUTATIONS)]
        self.assertEqual(len(made), MUTATIONS)
        target, out, refusals = self.path("mutated.ckpt"), self.path("out.safetensors"), 0
        run = range(0 if ALL else self.random.randrange(5), MUTATIONS, 1 if ALL else 5)
        for i in run:
            name, data = made[i]
            with self.subTest(name=name):
                pathlib.Path(target).write_bytes(data)
                names = sorted(os.listdir(self.folder))
                code, result, err = support.run("weights", "import", target, "--output", out, *self.more)
                self.assertFalse(os.path.exists(self.broken.canary), "something was run")
                if i >= certain and code == 0:  # bits that are never read: dates, padding
                    with open(out, "rb") as f:
                        self.assertEqual(f.read(), self.right)
                    os.remove(out)
                else:
                    self.assertEqual((code, result), (1, ""), err)
                    self.assertIn("mutated.ckpt", err)
                    self.assertFalse(any(ord(c) < 32 and c != "\n" for c in err), repr(err))
                    self.assertLess(len(err), 1500)
                    refusals += 1
                self.assertEqual(names, sorted(os.listdir(self.folder)), "something was written")
        print(f"{len(run)} mutations, {refusals} refused, {len(run) - refusals} changed nothing that is read", file=sys.stderr)

    def test_any_byte_of_the_pickle(self):
        """With a valid checksum: whatever is then accepted is a model."""
        for _ in range(60 if ALL else 12):
            data = bytearray(self.broken.pickle)
            at = self.random.randrange(len(data))
            data[at] = self.random.randrange(256)
            pathlib.Path(self.path("mutated.ckpt")).write_bytes(self.broken.with_pickle(bytes(data)))
            code, _, err = support.run("weights", "import", self.path("mutated.ckpt"), "--output", self.path("out.safetensors"), "--overwrite", *self.more)
            self.assertIn(code, (0, 1, 2), err)
            self.assertFalse(os.path.exists(self.broken.canary))
            if code == 0:
                self.succeeds("weights", "verify", self.path("out.safetensors"))


class Hostile(Mutations, Checkpoints):
    """VS-Splat's checkpoint, which PyTorch has made."""
    def setUp(self):
        super().setUp()
        self.begin(self.path("lightning.ckpt"))


class HostileLara(Mutations, support.Case):
    def setUp(self):
        super().setUp()
        self.begin(Lara.CHECKPOINT)


class HostileGenden(Mutations, support.Case):
    def setUp(self):
        super().setUp()
        self.begin(Genden.CHECKPOINT)


class HostileDinov3(Mutations, support.Case):
    def setUp(self):
        super().setUp()
        self.begin(Dinov3.CHECKPOINT, *Dinov3.FIELDS)


if __name__ == "__main__":
    support.main()
