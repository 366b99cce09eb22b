"""vsplat weights import: PyTorch's checkpoints become models to the bit, and those that are damaged or hostile are refused: nothing in them is
run, nothing is written."""
import io
import json
import os
import pickle
import random
import struct
import subprocess
import unittest
import zipfile
import zlib

import support

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
MAKER = os.path.join(ROOT, "tests", "reference", "pytorch", "run.sh")
MUTATIONS = 300


def tensors(path):
    """-> {name: (shape, bytes)} of a safetensors file"""
    data = open(path, "rb").read()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    return {name: (entry["shape"], data[8 + size + entry["data_offsets"][0]:8 + size + entry["data_offsets"][1]])
            for name, entry in header.items() if name != "__metadata__"}


def zipped(entries, method=zipfile.ZIP_STORED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as z:
        for name, content in entries:
            z.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content, method)
    return out.getvalue()


class Checkpoints(support.Case):
    """With PyTorch's files of a model beside each."""
    def setUp(self):
        super().setUp()
        # As weights of the published code are imported.
        self.succeeds("init", "micro", "--seed", 3, "--set", "negate_camera_centre=true", "--output", self.model, "--overwrite")
        self.other = self.path("other.safetensors")
        self.succeeds("init", "micro", "--seed", 4, "--set", "fine_count=3", "--set", "volume_ch=8", "--set", "negate_camera_centre=true", "--output", self.other)
        done = subprocess.run([MAKER, "make_checkpoints.py", self.folder, self.model, self.other], capture_output=True, text=True, timeout=280)
        if done.returncode == 77:
            self.skipTest(done.stderr)
        self.assertEqual(done.returncode, 0, done.stderr)

    def imports(self, name, *more):
        """-> what is told, as JSON, and stderr"""
        out, err = self.succeeds("weights", "import", self.path(name), "--output", self.path("got.safetensors"), "--overwrite", "--json", *more)
        return json.loads(out), err


class Import(Checkpoints):
    def refused(self, words, name, *more, code=1):
        """Nothing is written, and what the error says is fit for a terminal."""
        err = self.refuses(code, words, "weights", "import", self.path(name), "--output", self.path("none.safetensors"), *more)
        self.assertFalse(any(ord(c) < 32 and c != "\n" for c in err), repr(err))
        return err

    def info(self, path):
        return json.loads(self.succeeds("weights", "info", path, "--json")[0])

    def test_the_same_to_the_bit(self):
        scenes = set()
        for name in ("lightning.ckpt", "bare.pth", "wrapped.pth", "strided.ckpt", "more.ckpt"):
            with self.subTest(name=name):
                told, _ = self.imports(name)
                self.assertEqual(told["named"], "micro")
                self.assertEqual(told["config"], self.info(self.model)["config"])
                self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.model))
                self.assertIn("imported", self.info(self.path("got.safetensors"))["provenance"]["origin"])
                self.succeeds("weights", "verify", self.path("got.safetensors"))
                self.succeeds("reconstruct", self.views, "--model", self.path("got.safetensors"), "--output", self.path("got.ply"), "--overwrite")
                scenes.add(open(self.path("got.ply"), "rb").read())
        self.succeeds(*self.reconstruct())
        self.assertEqual(scenes, {open(self.path("out.ply"), "rb").read()})

    def test_values_of_other_types(self):
        for name in ("half", "bfloat"):
            self.imports(name + ".ckpt")
            got = b"".join(data for _, data in tensors(self.path("got.safetensors")).values())
            self.assertEqual(got, open(self.path(name + ".raw"), "rb").read(), name)
        self.refused(["F64", "F32, F16 or BF16"], "double.ckpt")

    def test_what_was_left_out_is_listed(self):
        told, err = self.imports("more.ckpt")
        self.assertEqual(told["left_out"], ["loss.lpips.weight", "net.encoder.model.head.weight", "net.centers", "epoch", "global_step", "pytorch-lightning_version",
                                            "loops", "callbacks", "optimizer_states", "lr_schedulers"])
        for name in told["left_out"]:
            self.assertIn(f"left out: {name}\n", err)
        self.assertIn(f"vsplat weights check {self.path('got.safetensors')}", err)
        self.assertEqual(self.imports("bare.pth")[0]["left_out"], [])

    def test_what_shapes_do_not_tell(self):
        self.refused(["vit_heads, groups, image, volume", "--set", "--config"], "other.ckpt", code=2)
        fields = {"vit_heads": 2, "groups": 2, "image": 16, "volume": 4}
        for left in fields:
            given = [word for name, value in fields.items() if name != left for word in ("--set", f"{name}={value}")]
            err = self.refused(f"do not tell {left}:", "other.ckpt", *given, code=2)
            self.assertNotIn("vsplat_", err)
        json.dump({**fields, "views": 2, "image": 24}, open(self.path("fields.json"), "w"))
        told, _ = self.imports("other.ckpt", "--config", self.path("fields.json"), "--set", "image=16")
        self.assertIsNone(told["named"])
        self.assertEqual(told["config"], self.info(self.other)["config"])
        self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.other))
        # Of a named one all can be changed that shapes do not tell, and nothing that they tell.
        told, _ = self.imports("lightning.ckpt", "--set", "image=24", "--set", "negate_camera_centre=false")
        self.assertEqual(told["config"], {**self.info(self.model)["config"], "image": 24, "negate_camera_centre": False})
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
        self.refused("parts of it stand for many values", "repeated.ckpt")
        self.refused([name, "I64", "F32"], "whole.ckpt")
        self.refused([name, "nan"], "nan.ckpt")
        self.refused(["missing", "dir_norm.mlp.0.weight"], "text.ckpt")
        self.refused(["net.predictor.third.weight"], "extra.ckpt")
        self.refused(["torch._utils _rebuild_sparse_tensor"], "sparse.ckpt")
        self.refused(["torch ComplexFloatStorage"], "complex.ckpt")

    def test_other_files_are_told_by_name(self):
        for words, name in (("LaRa", "lara.ckpt"), ("GenDen's network", "genden.ckpt"), ("with GenDen's densifier", "densified.ckpt"), ("Plücker", "share.ckpt"),
                            (["DINOv3", "Hugging Face"], "dinov3.pth"), ("no dict", "list.pth"), ("no tensors", "empty.pth"),
                            (["before PyTorch 1.6", "save it again"], "old.pth"), (["protocol 4", "expected 2"], "protocol.pth"),
                            ("torch.nn.modules.linear Linear", "module.pth"), ("compressed", "script.pt"), ("no zip archive", "model.safetensors")):
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
        self.assertEqual(len({open(path, "rb").read() for path in made}), 1)
        for words, name in (("register_tokens", "dinov3.pth"), ("cls_token", "lara.ckpt"), ("protocol 4", "protocol.pth")):
            self.refuses(1, words, "init", "micro", "--seed", 9, "--encoder", self.path(name), "--output", self.path("none.safetensors"))

    def test_an_encoder_becomes_a_model_about_it(self):
        told, err = self.imports("dino.pth")
        self.assertEqual((told["named"], told["encoder_alone"], told["left_out"]), ("micro", True, []))
        self.assertIn("vsplat train --init", err)
        self.succeeds("init", "micro", "--seed", 0, "--encoder", self.path("dino.pth"), "--output", self.path("made.safetensors"))
        self.assertEqual(tensors(self.path("got.safetensors")), tensors(self.path("made.safetensors")))
        self.assertIn("random", self.info(self.path("got.safetensors"))["provenance"]["origin"])


class Dinov3(support.Case):
    """Its encoder in Meta's naming, which is committed: PyTorch is not asked for."""
    CHECKPOINT = os.path.join(ROOT, "tests", "golden", "dinov3_micro_meta.pth")
    FIELDS = [word for field in ("vit_heads=2", "groups=2", "image=16", "volume=4", "volume_ch=4", "voxel_ch=8", "fine_dim=8", "views=2") for word in ("--set", field)]

    def test_becomes_a_model_that_reconstructs(self):
        self.refuses(2, "do not tell vit_heads, groups, image, volume:", "weights", "import", self.CHECKPOINT, "--output", self.path("none.safetensors"))
        made = self.path("dinov3.safetensors")
        told = json.loads(self.succeeds("weights", "import", self.CHECKPOINT, "--output", made, "--json", *self.FIELDS)[0])
        self.assertEqual((told["config"]["encoder"], told["config"]["vit_registers"], told["encoder_alone"]), ("dinov3", 2, True))
        self.assertEqual(sorted(told["left_out"]), ["blocks.0.attn.qkv.bias", "blocks.0.attn.qkv.bias_mask", "mask_token", "rope_embed.periods"])
        self.succeeds("weights", "verify", made)
        self.succeeds("reconstruct", self.views, "--model", made, "--output", self.path("got.ply"))
        fields = [word for field in ("encoder=dinov3", "vit_registers=2", "vit_dim=16") for word in ("--set", field)]
        self.succeeds("init", "micro", "--seed", 1, *fields, "--encoder", self.CHECKPOINT, "--output", self.path("init.safetensors"))
        self.assertEqual(tensors(self.path("init.safetensors"))["encoder.model.reg_token"], tensors(made)["encoder.model.reg_token"])


class Lara(support.Case):
    """LaRa's, whose checkpoint is committed: PyTorch is not asked for."""
    CHECKPOINT = os.path.join(ROOT, "tests", "golden", "lara_micro.ckpt")

    def test_becomes_a_model(self):
        made = self.path("lara.safetensors")
        told = json.loads(self.succeeds("weights", "import", self.CHECKPOINT, "--output", made, "--json")[0])
        self.assertEqual((told["system"], told["named"], told["parameters"]), ("lara", "micro", 9390))
        self.assertIn("net.group_centers", told["left_out"])
        info = json.loads(self.succeeds("weights", "info", made, "--json")[0])
        self.assertEqual((info["system"], info["config"]), ("lara", told["config"]))
        self.assertIn("lara", self.succeeds("weights", "info", made)[0])
        self.succeeds("weights", "verify", made)
        self.succeeds("weights", "convert", made, "--dtype", "f16", "--output", self.path("half.safetensors"))
        self.assertEqual(json.loads(self.succeeds("weights", "info", self.path("half.safetensors"), "--json")[0])["system"], "lara")
        self.refuses(2, ["LaRa's network", "VS-Splat's"], "weights", "convert", made, "--dtype", "f32", "--view-count", 3, "--output", self.path("more.safetensors"))

    def test_reconstructs(self):
        made, scene = self.path("lara.safetensors"), self.path("scene.ply")
        self.succeeds("weights", "import", self.CHECKPOINT, "--output", made)
        self.succeeds("reconstruct", self.views, "--model", made, "--center", "0,0,0", "--scale", 1, "--output", scene)
        header = open(scene, "rb").read().split(b"end_header")[0].decode()
        self.assertIn("property float scale_1", header)
        self.assertNotIn("property float scale_2", header)  # surfels
        self.assertNotIn("element vertex 0", header)
        self.succeeds("reconstruct", self.views, "--model", made, "--dry-run")
        many = self.make_views("many", count=5)
        self.refuses(2, ["5 views", "1 to 3", "view_slots"], "reconstruct", many, "--model", made, "--view-count", 5, "--output", self.path("none.ply"))
        self.refuses(2, "selects no voxels", "reconstruct", self.views, "--model", made, "--selection-seed", 1, "--output", self.path("none.ply"))
        self.refuses(2, ["LaRa's network", "VS-Splat's"], "refine", self.views, "--model", made, "--start", "network", "--steps", 1, "--output", self.path("none.ply"))

    def test_what_is_another_networks_is_refused(self):
        self.refuses(2, ["view_slots", "3", "4"], "weights", "import", self.CHECKPOINT, "--set", "view_slots=4", "--output", self.path("none.safetensors"))
        self.refuses(2, "volume_mult", "weights", "import", self.CHECKPOINT, "--set", "volume_mult=1", "--output", self.path("none.safetensors"))


class Genden(support.Case):
    """GenDen's, whose checkpoint is committed, too."""
    CHECKPOINT = os.path.join(ROOT, "tests", "golden", "genden_micro.ckpt")

    def test_becomes_a_model_and_reconstructs(self):
        made, scenes = self.path("genden.safetensors"), [self.path(f"{name}.ply") for name in ("first", "again", "other")]
        told = json.loads(self.succeeds("weights", "import", self.CHECKPOINT, "--output", made, "--json")[0])
        self.assertEqual((told["system"], told["named"], told["parameters"]), ("genden", "micro", 21208))
        self.assertEqual(told["config"]["densify.top_k"], 9)
        self.succeeds("weights", "verify", made)
        for scene, seed in zip(scenes, (0, 0, 4)):
            self.succeeds("reconstruct", self.views, "--model", made, "--center", "0,0,0", "--scale", 1, "--selection-seed", seed, "--output", scene)
        first, again, other = (open(scene, "rb").read() for scene in scenes)
        self.assertIn(b"property float scale_2", first)
        self.assertEqual(first, again)
        self.assertNotEqual(first, other)  # the curves in another order
        self.assertIn("densify", self.succeeds("reconstruct", self.views, "--model", made, "--dry-run")[0])
        residual = self.path("residual.safetensors")
        self.succeeds("weights", "import", self.CHECKPOINT, "--set", "densify.residual=true", "--output", residual)
        self.assertTrue(json.loads(self.succeeds("weights", "info", residual, "--json")[0])["config"]["densify.residual"])


class Canary:
    """Unpickled by Python, it makes a file."""
    def __init__(self, path, call=os.system):
        self.path, self.call = path, call

    def __reduce__(self):
        if self.call in (eval, exec):
            return self.call, (f"open({self.path!r}, 'w')",)
        return self.call, (["touch", self.path] if self.call is subprocess.check_call else f"touch {self.path}",)


class Hostile(Checkpoints):
    """300 files that are damaged or meant to break their reader."""
    def setUp(self):
        super().setUp()
        self.random = random.Random(7)
        self.canary = self.path("canary")
        with zipfile.ZipFile(self.path("lightning.ckpt")) as z:
            self.entries = [(i.filename, z.read(i)) for i in z.infolist()]
        self.top = self.entries[0][0].split("/")[0]
        self.pickle = dict(self.entries)[f"{self.top}/data.pkl"]
        self.whole = open(self.path("lightning.ckpt"), "rb").read()
        self.imports("lightning.ckpt")
        self.right = open(self.path("got.safetensors"), "rb").read()
        os.remove(self.path("got.safetensors"))

    def with_pickle(self, data, **changes):
        return zipped([(name, data if name.endswith("data.pkl") else content) for name, content in self.entries])

    def hostile_pickles(self):
        """-> what each is, and its bytes"""
        for call in (os.system, eval, exec, subprocess.check_call, os.popen):
            danger = Canary(self.canary, call)
            for place in ({"state_dict": danger}, {"state_dict": {"net.div_offset": danger}}, {"state_dict": {}, "callbacks": [danger]}, danger, [danger]):
                yield f"{call.__name__} {type(place).__name__}", pickle.dumps(place, 2)
            yield f"{call.__name__} 4", pickle.dumps(danger, 4)
            # What a reader would call before it sees the rest, and where it looks at nothing.
            yield f"{call.__name__} before", b"\x80\x02" + pickle.dumps(danger, 2)[2:-1] + b"0" + self.pickle[2:]
            yield f"{call.__name__} in a list", b"\x80\x02]" + pickle.dumps(danger, 2)[2:-1] + b"a" + self.pickle[2:]
        touch = b"X" + struct.pack("<I", len(self.canary) + 6) + b"touch " + self.canary.encode()
        for name, code in (("inst", b"(" + touch + b"ios\nsystem\n."), ("obj", b"(cos\nsystem\n" + touch + b"o."), ("stack", b"\x8c\x02os\x8c\x06system\x93" + touch + b"\x85R."),
                           ("newobj", b"cos\nsystem\n" + touch + b"\x85\x81."), ("ext", b"\x82\x01" + touch + b"\x85R."), ("persid", b"Pos.system\n."),
                           ("getattr", b"c__builtin__\ngetattr\n."), ("import", b"c__builtin__\n__import__\n."), ("twice", b"ccollections\nOrderedDict\n)R" + touch + b"\x85R."),
                           ("call a text", touch + touch + b"\x85R."), ("call a storage", b"ctorch\nFloatStorage\n" + touch + b"\x85R."),
                           ("build a text", touch + b"}b."), ("no mark", b"t."), ("no value", b"."), ("two values", b"NN."), ("get", b"h\x05."), ("put far", b"Nr\xff\xff\xff\xff."),
                           ("long text", b"X\xff\xff\xff\xff."), ("long", b"\x8a\xff" + b"\x01" * 255 + b"."), ("long4", b"\x8b\xff\xff\xff\x7f."), ("open", b"}q\0("), ("self", b"}q\0h\0h\0s."),
                           ("deep tuples", b"N" + b"\x85" * 1_000_000 + b"."), ("deep lists", b"]" * 600_000 + b"a" * 599_999 + b"."), ("marks", b"(" * 2_000_000 + b"."),
                           ("many", b"(" + b"N" * 3_000_000 + b"t."), ("same", b"]q\0(" + b"h\0" * 6_000_000 + b"e."), ("escape", b"c\x1b]0;owned\x07\n\x9b2J\n.")):
            yield name, b"\x80\x02" + code

    def tensor_pickles(self):
        """State dicts whose tensors do not lie in their storages, and storages that are elsewhere."""
        def number(n):
            return b"\x8a\x08" + struct.pack("<q", n)
        def sides(values):
            return b"(" + b"".join(map(number, values)) + b"t"
        def text(word):
            return b"X" + struct.pack("<I", len(word)) + word.encode()
        def state(kind="FloatStorage", key="0", count=6, offset=0, shape=(2, 3), strides=(3, 1), tag="storage"):
            storage = b"(" + text(tag) + b"ctorch\n" + kind.encode() + b"\n" + text(key) + text("cpu") + number(count) + b"tQ"
            return (b"\x80\x02}" + text("net.encoder.model.cls_token") + b"ctorch._utils\n_rebuild_tensor_v2\n(" + storage + number(offset) + sides(shape) + sides(strides)
                    + b"\x89ccollections\nOrderedDict\n)RtRs.")
        big = 2**62
        for name, change in (("offset", {"offset": 1}), ("offset far", {"offset": big}), ("offset before", {"offset": -1}), ("stride", {"strides": (4, 1)}),
                             ("stride before", {"strides": (-3, 1)}), ("shape", {"shape": (3, 3)}), ("shape far", {"shape": (big, big)}), ("expanded", {"shape": (big, 8), "strides": (0, 0)}),
                             ("shape before", {"shape": (-2, -3)}), ("ranks", {"strides": (1,)}), ("sides", {"shape": (1,) * 20, "strides": (1,) * 20}), ("count", {"count": 7}),
                             ("count far", {"count": big}), ("count before", {"count": -1}), ("key", {"key": "../../../etc/passwd"}), ("key absolute", {"key": "/etc/passwd"}),
                             ("no key", {"key": ""}), ("no entry", {"key": "99999"}), ("kind", {"kind": "QInt8Storage"}), ("kind of another module", {"kind": "load"}), ("tag", {"tag": "module"}),
                             ("size", {"kind": "DoubleStorage"})):
            entries = [(f"{self.top}/data.pkl", state(**change)), (f"{self.top}/data/0", b"\0" * 24)]
            yield name, zipped(entries)

    def archives(self):
        entries = self.entries
        pickled = (f"{self.top}/data.pkl", self.pickle)
        outside = os.path.relpath(self.canary, "/")
        for name in (f"../{outside}", "../" * 20 + outside, self.canary, f"{self.top}/../{outside}", f"{self.top}/data/../../x", "..", f"{self.top}\\..\\x", f"{self.top}/\x1b[2J", f"{self.top}//x",
                     "./x"):
            yield f"name {name!r}", zipped([*entries, (name, b"x")])
        yield "only outside", zipped([("../data.pkl", self.pickle), *entries[1:]])
        yield "two pickles", zipped([*entries, ("other/data.pkl", self.pickle)])
        yield "no pickle", zipped(entries[1:])
        yield "big", zipped([*entries, (f"{self.top}/byteorder", b"big")])
        yield "byteorder", zipped([*entries, (f"{self.top}/byteorder", b"x" * 100_000)])
        yield "twice", zipped([*entries, entries[-1]])
        yield "deflated", zipped(entries, zipfile.ZIP_DEFLATED)
        yield "bomb in the pickle", zipped([(pickled[0], b"\x80\x02" + b"N" * 200_000_000)], zipfile.ZIP_DEFLATED)
        yield "bomb in an entry", zipped([*entries, (f"{self.top}/data/99999", b"\0" * 200_000_000)], zipfile.ZIP_DEFLATED)
        # Sizes that nothing is behind, in the list and where the entries begin.
        for claim in (2**31, 2**32 - 2, 2**32 - 1):
            data = bytearray(zipped(entries))
            for mark, at in ((b"PK\x01\x02", 20), (b"PK\x03\x04", 18)):
                begin = data.find(mark)
                data[begin + at:begin + at + 8] = struct.pack("<II", claim, claim)
            yield f"claims {claim}", bytes(data)
        # Every entry where the first one is: together more than the file.
        data = bytearray(zipped([(f"{self.top}/data/{i}", b"\0" * 50_000) for i in range(3)] + [pickled]))
        at = -1
        while (at := data.find(b"PK\x01\x02", at + 1)) >= 0:
            data[at + 42:at + 46] = struct.pack("<I", 0)
        yield "overlap", bytes(data)
        data = bytearray(zipped(entries))
        for mark, at in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):  # all are encrypted
            begin = -1
            while (begin := data.find(mark, begin + 1)) >= 0:
                data[begin + at] |= 1
        yield "encrypted", bytes(data)
        yield "a picture", zlib.compress(b"x" * 1000)
        yield "end alone", b"PK\x05\x06" + b"\0" * 18
        yield "entries without number", b"PK\x05\x06\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff\0\0\0\0\0\0"
        yield "pickle of another", zipped([(f"{self.top}/data.pkl", pickle.dumps({"state_dict": {"a": [1.5, "x"]}}, 2))])

    def test_mutations(self):
        made = [(name, self.with_pickle(data)) for name, data in self.hostile_pickles()] + list(self.tensor_pickles()) + list(self.archives())
        certain = len(made)
        for i in range(60):
            made.append((f"cut {i}", self.whole[:self.random.randrange(len(self.whole))]))
        certain += 60
        while len(made) < MUTATIONS:
            data = bytearray(self.whole)
            for _ in range(self.random.choice((1, 1, 2, 8))):
                data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
            made.append((f"bits {len(made)}", bytes(data)))
        self.assertEqual(len(made), MUTATIONS)
        target, out, refusals = self.path("mutated.ckpt"), self.path("out.safetensors"), 0
        for i, (name, data) in enumerate(made):
            with self.subTest(name=name):
                open(target, "wb").write(data)
                names = sorted(os.listdir(self.folder))
                code, told, err = support.run("weights", "import", target, "--output", out)
                self.assertFalse(os.path.exists(self.canary), "something was run")
                if i >= certain and code == 0:  # bits of what nobody reads: dates, padding
                    self.assertEqual(open(out, "rb").read(), self.right)
                    os.remove(out)
                else:
                    self.assertEqual((code, told), (1, ""), err)
                    self.assertIn("mutated.ckpt", err)
                    self.assertFalse(any(ord(c) < 32 and c != "\n" for c in err), repr(err))
                    self.assertLess(len(err), 1500)
                    refusals += 1
                self.assertEqual(names, sorted(os.listdir(self.folder)), "something was written")
        print(f"{MUTATIONS} mutations, {refusals} refused, {MUTATIONS - refusals} changed nothing that is read")

    def test_any_byte_of_the_pickle(self):
        """With a checksum that fits: whatever is then taken is a model."""
        for _ in range(60):
            data = bytearray(self.pickle)
            at = self.random.randrange(len(data))
            data[at] = self.random.randrange(256)
            open(self.path("mutated.ckpt"), "wb").write(self.with_pickle(bytes(data)))
            code, _, err = support.run("weights", "import", self.path("mutated.ckpt"), "--output", self.path("out.safetensors"), "--overwrite")
            self.assertIn(code, (0, 1, 2), err)
            self.assertFalse(os.path.exists(self.canary))
            if code == 0:
                self.succeeds("weights", "verify", self.path("out.safetensors"))


if __name__ == "__main__":
    support.main()
