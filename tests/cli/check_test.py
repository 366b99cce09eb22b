"""vsplat weights check: whether a model's weights work, measured on the input views of a built-in object."""
import json
import os
import pathlib
import struct

import support

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
SHIPPED = os.path.join(ROOT, "model", "weights", "model.safetensors")


def reversed_values(path, to, name, size=2):
    """The same model with a tensor's values in reverse order, as if the weights were read wrongly, and without its hash."""
    data = pathlib.Path(path).read_bytes()
    begin = 8 + struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:begin])
    header["__metadata__"].pop("sha256", None)
    first, end = (begin + at for at in header[name]["data_offsets"])
    values = [data[at:at + size] for at in range(first, end, size)]
    text = json.dumps(header).encode()
    pathlib.Path(to).write_bytes(struct.pack("<Q", len(text)) + text + data[begin:first] + b"".join(reversed(values)) + data[end:])


def on_white(path):
    _, _, data = support.read_png(path)  # straight alpha
    return [(data[i + c] * data[i + 3] + 255 * (255 - data[i + 3])) / 255 for i in range(0, len(data), 4) for c in range(3)]


class Check(support.Case):
    def check(self, *words):
        """Returns the JSON; stderr has the warning and nothing else."""
        out, err = self.succeeds("weights", "check", *words, "--json", "--quiet")
        result = json.loads(out)
        self.assertEqual(err, "" if result["warning"] is None else f"warning: {result['warning']}\n")
        self.assertEqual(result["below_nearest"], result["warning"] is not None)
        return result

    def test_random_weights_are_found_in_every_system(self):
        """The object is the same for all models of a size; each mean is that of the views."""
        nearest = {}
        for system, size in (("vsplat", "small"), ("lara", "small"), ("vsplat", "tiny"), ("lara", "tiny"), ("genden", "tiny"), ("vsplat+genden", "small")):
            with self.subTest(system=system):
                model = self.path(f"{system}-{size}.safetensors")
                self.succeeds("init", size, "--system", system, "--seed", 3, "--output", model)
                result = self.check(model)
                config = json.loads(self.succeeds("weights", "info", model, "--json")[0])["config"]
                self.assertEqual(list(result), ["model", "object", "image", "views", "psnr", "psnr_nearest", "below_nearest", "gaussians", "warning"])
                self.assertEqual((result["model"], result["image"], len(result["views"])), (model, config["image"], max(2, config["views"])))
                self.assertEqual(len({view["name"] for view in result["views"]}), len(result["views"]))
                for number in ("psnr", "psnr_nearest"):
                    self.assertAlmostEqual(result[number], sum(view[number] for view in result["views"]) / len(result["views"]), 9)
                self.assertTrue(result["below_nearest"])
                self.assertIn("untrained", result["warning"])
                key = result["image"], len(result["views"])
                self.assertEqual(nearest.setdefault(key, result["psnr_nearest"]), result["psnr_nearest"])
        self.assertEqual(result, self.check(model))

    def test_a_trained_model_passes_and_one_read_wrongly_does_not(self):
        result = self.check(SHIPPED)
        self.assertIsNone(result["warning"])
        self.assertGreater(result["psnr"], result["psnr_nearest"] + 4)
        out, err = self.succeeds("weights", "check", SHIPPED)
        self.assertNotIn("warning", err)
        self.assertIn(f"mean                 {result['psnr']:.2f} dB (nearest other view: {result['psnr_nearest']:.2f} dB)\n", out)
        self.assertEqual(out.count(" dB (nearest other view: "), 1 + len(result["views"]))
        damaged = self.path("damaged.safetensors")
        reversed_values(SHIPPED, damaged, "encoder.model.patch_embed.proj.weight")
        wrong = self.check(damaged)
        self.assertEqual(wrong["psnr_nearest"], result["psnr_nearest"])
        self.assertIsNotNone(wrong["warning"])
        out, err = self.succeeds("weights", "check", damaged)
        self.assertIn("warning: the drawn input views reach ", err)

    def test_the_numbers_are_those_of_other_commands(self):
        """The same object, made by `dataset procedural`, reconstructed and drawn from its input views' cameras."""
        result = self.check(SHIPPED)
        self.assertEqual(result["object"], "procedural 0")
        self.succeeds("dataset", "procedural", "--count", 1, "--seed", 20, "--views", 40, "--size", result["image"], "--output", self.path("set"))
        folder = self.path("set", "object_0000")
        names = [view["name"] for view in result["views"]]
        out, _ = self.succeeds("reconstruct", folder, "--model", SHIPPED, "--passes", 1, "--merge-cell", "none", "--fit-epochs", 0, "--views", ",".join(names), "--output", self.path("o.ply"), "--render", folder,
                               "--compare", os.path.join(folder, "images"), "--json")
        drawn = {os.path.relpath(picture["reference"], folder): picture["psnr"] for picture in json.loads(out)["comparison"]["pictures"]}
        for view in result["views"]:
            self.assertAlmostEqual(view["psnr"], drawn[view["name"]], delta=1e-3)
        pixels = {name: on_white(os.path.join(folder, name)) for name in names}
        for view in result["views"]:  # that of one of the other views
            others = [support.psnr(pixels[view["name"]], pixels[name]) for name in names if name != view["name"]]
            self.assertLess(min(abs(view["psnr_nearest"] - other) for other in others), 0.02)

    def test_what_cannot_be_checked(self):
        self.refuses(1, "nowhere.safetensors", "weights", "check", self.path("nowhere.safetensors"))
        self.refuses(1, "--device", "weights", "check", self.model, "--device", "no such device")
        self.succeeds("weights", "check", self.model, "--profile", self.path("profile.json"))
        self.assertIn("rasterize", open(self.path("profile.json")).read())
        self.refuses(1, "profile.json", "weights", "check", self.model, "--profile", self.path("profile.json"))


if __name__ == "__main__":
    support.main()
