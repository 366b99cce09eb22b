"""--precision: mixed is reported, gives the same bytes each time and pictures like fp32's, and is refused if it is not available."""
import glob
import json
import os
import pathlib

import support

EMULATED = {"VSPLAT_MATRIX": "emulated", "VSPLAT_MATRIX_LEAST": "1"}  # also for products of a small model


class Precision(support.Case):
    def reconstructed(self, name, *more, env=EMULATED):
        """Returns the scene's bytes, stdout and stderr."""
        out, err = self.succeeds("reconstruct", self.views, "--model", self.model, "--output", self.path(name), "--json", *more, env=env)
        with open(self.path(name), "rb") as scene:
            return scene.read(), json.loads(out), err

    def test_mixed_is_reported_and_gives_the_same_bytes(self):
        exact, result, err = self.reconstructed("fp32.ply", "--kernels", "gpu", "--gemm", "own")
        self.assertEqual(result["precision"], "fp32")
        self.assertNotIn("matrix_unit", result)
        self.assertNotIn("mixed", err)
        mixed, result, err = self.reconstructed("mixed.ply", "--precision", "mixed", "--profile", self.path("p.json"))
        self.assertEqual((result["precision"], result["matrix_unit"]), ("mixed", "emulated"))
        self.assertIn("gpu kernels, mixed precision (emulated)", err)
        self.assertIn("slower than fp32", err)
        with open(self.path("p.json")) as profile:
            self.assertEqual(json.load(profile)["precision"], "mixed")
        self.assertNotEqual(mixed, exact)
        for name in ("again.ply", "once_more.ply"):
            self.assertEqual(self.reconstructed(name, "--precision", "mixed")[0], mixed)
        self.assertEqual(self.reconstructed("explicit.ply", "--precision", "fp32", "--kernels", "gpu", "--gemm", "own")[0], exact)

    def test_what_multiplies_in_fp32_is_refused(self):
        self.refuses(2, ["CLBlast multiplies in fp32"], *self.reconstruct("--precision", "mixed", "--gemm", "clblast"))
        self.refuses(2, ["--precision"], *self.reconstruct("--precision", "fp16"))
        self.refuses(2, ["--precision"], "render", self.path("no.ply"), "--precision", "mixed")

    def test_a_training_goes_on_to_the_same_bytes(self):
        with open(self.path("train.json"), "w") as config:
            json.dump({"model": "micro", "steps": 4, "checkpoint_every": 2, "keep_checkpoints": 2}, config)
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("set"), "--views", 8, "--size", self.SIDE, "--seed", 4)

        def trained(name, *more):
            self.succeeds("train", self.path("train.json"), "--data", self.path("set"), "--output", self.path(name), *more, env=EMULATED)
            with open(self.path(name, "model.safetensors"), "rb") as model:
                return model.read()

        mixed = ["--precision", "mixed"]
        whole = trained("whole", *mixed)
        self.assertNotEqual(trained("fp32", "--kernels", "gpu", "--gemm", "own"), whole)
        os.remove(self.path("whole", "checkpoint-00000004.safetensors"))
        os.remove(self.path("whole", "model.safetensors"))
        self.assertEqual(trained("whole", *mixed, "--resume"), whole)

    def test_cpu_kernels_need_the_processors_instructions(self):
        without = {"VSPLAT_LIMITS": "matrix=0"}
        self.refuses(2, ["avx512_bf16", "ask for the gpu kernels"], *self.reconstruct("--precision", "mixed", "--kernels", "cpu"), env=without)
        named = {**without, "VSPLAT_MATRIX": "avx512bf16"}
        self.refuses(1, ["VSPLAT_MATRIX=avx512bf16", "avx512_bf16 instructions"], *self.reconstruct("--precision", "mixed"), env=named)
        scene, result, err = self.reconstructed("emulated.ply", "--precision", "mixed", "--kernels", "cpu")
        self.assertEqual(result["matrix_unit"], "emulated")
        self.assertIn("cpu kernels, mixed precision (emulated)", err)
        self.assertEqual(self.reconstructed("once_more.ply", "--precision", "mixed", "--kernels", "cpu")[0], scene)

    def test_the_processors_instructions_are_used_when_they_are_there(self):
        env = {"VSPLAT_MATRIX_LEAST": "1", "VSPLAT_CACHE_DIR": self.path("cache"), "VSPLAT_SELFTEST": ""}
        scene, result, err = self.reconstructed("one.ply", "--precision", "mixed", env=env)
        if result["matrix_unit"] not in ("amx", "avx512bf16"):
            self.skipTest("a device without them")
        self.assertIn(f"cpu kernels, mixed precision ({result['matrix_unit']})", err)
        self.assertNotIn("slower than fp32", err)
        for name in ("two.ply", "three.ply"):
            self.assertEqual(self.reconstructed(name, "--precision", "mixed", env=env)[0], scene)
        exact = self.reconstructed("fp32.ply", "--kernels", "cpu", env=env)[0]
        self.assertNotEqual(exact, scene)

    def test_auto_takes_mixed_where_a_self_test_has_found_it_as_good(self):
        env = {"VSPLAT_MATRIX_LEAST": "1", "VSPLAT_CACHE_DIR": self.path("cache"), "VSPLAT_SELFTEST": ""}
        mixed, result, _ = self.reconstructed("mixed.ply", "--precision", "mixed", env=env)
        has_units = result["matrix_unit"] != "emulated"
        exact = self.reconstructed("fp32.ply", env=env)[0]
        scene, result, err = self.reconstructed("before.ply", "--precision", "auto", env=env)
        self.assertEqual((scene, result["precision"], result["matrix_unit"]), (exact, "fp32", None))
        self.assertIn("no self-test has found mixed precision as good", err)
        self.succeeds("selftest", "--quick", "--json", env=env)
        [path] = glob.glob(self.path("cache", "verdicts", "*.json"))
        verdict = json.loads(pathlib.Path(path).read_text())
        self.assertNotIn("mixed_loss", verdict, "a quick self-test does not measure it")
        for loss, as_good in ((0.019, True), (-0.3, True), (0.021, False)):
            pathlib.Path(path).write_text(json.dumps({**verdict, "mixed_loss": loss}))
            scene, result, _ = self.reconstructed("auto.ply", "--precision", "auto", "--overwrite", env=env)
            self.assertEqual(result["precision"], "mixed" if as_good and has_units else "fp32")
            self.assertEqual(scene, mixed if as_good and has_units else exact)
        pathlib.Path(path).write_text(json.dumps({**verdict, "verdict": "degraded", "mixed_loss": 0}))
        self.assertEqual(self.reconstructed("auto.ply", "--precision", "auto", "--overwrite", env=env)[1]["precision"], "fp32")
        pathlib.Path(path).write_text(json.dumps({**verdict, "mixed_loss": 0.001}))
        self.assertEqual(json.loads(self.succeeds("selftest", "--quick", "--json", env=env)[0])["mixed_loss"], 0.001, "stays")
        self.assertEqual(self.reconstructed("auto.ply", "--precision", "auto", "--overwrite", env={**env, "VSPLAT_SELFTEST": "ignore"})[1]["precision"], "fp32")
        self.refuses(2, ["--precision", "auto"], "train", self.path("none.json"), "--precision", "auto")

    @support.slow
    def test_a_whole_self_test_measures_what_mixed_loses(self):
        env = {"VSPLAT_CACHE_DIR": self.path("cache"), "VSPLAT_SELFTEST": ""}
        unit = self.reconstructed("mixed.ply", "--precision", "mixed", env=env)[1]["matrix_unit"]
        loss = json.loads(self.succeeds("selftest", "--json", env=env)[0])["mixed_loss"]
        [path] = glob.glob(self.path("cache", "verdicts", "*.json"))
        self.assertEqual(json.loads(pathlib.Path(path).read_text()).get("mixed_loss"), loss)
        precision = self.reconstructed("auto.ply", "--precision", "auto", env=env)[1]["precision"]
        if unit == "emulated":
            self.assertEqual((loss, precision), (None, "fp32"))
        else:
            self.assertLess(abs(loss), 0.05)
            self.assertNotEqual(loss, 0)
            self.assertEqual(precision, "mixed" if loss < 0.02 else "fp32")

    def test_units_that_do_not_work_are_left_out_and_remembered(self):
        """Units requested by name on a device that lacks them: their test fails, is reported once, and the emulated ones are used."""
        env = {**EMULATED, "VSPLAT_MATRIX": "wmma", "VSPLAT_CACHE_DIR": self.path("cache"), "VSPLAT_SELFTEST": ""}
        scene, result, err = self.reconstructed("one.ply", "--precision", "mixed", env=env)
        if result["matrix_unit"] == "wmma":
            self.skipTest("a device that has them")
        self.assertEqual(result["matrix_unit"], "emulated")
        self.assertIn("matrix units (wmma) are not used, since their test failed", err)
        again, result, err = self.reconstructed("two.ply", "--precision", "mixed", env=env)
        self.assertNotIn("their test failed", err)
        self.assertIn("mixed precision (emulated)", err)
        self.assertEqual(scene, again)
        self.refuses(2, ["VSPLAT_MATRIX", "tensor"], *self.reconstruct("--precision", "mixed"), env={"VSPLAT_MATRIX": "tensor"})

    def test_a_driver_that_crashes_in_their_test_does_so_once(self):
        """PoCL's compiler ends the process on NVIDIA's instructions; on other drivers they either do not compile, or work."""
        env = {**EMULATED, "VSPLAT_MATRIX": "ptx", "VSPLAT_CACHE_DIR": self.path("cache"), "VSPLAT_SELFTEST": ""}
        support.run(*self.reconstruct("--precision", "mixed"), env=env)
        _, result, err = self.reconstructed("one.ply", "--precision", "mixed", "--verbose", env=env)
        if result["matrix_unit"] == "emulated":
            self.assertIn("matrix units (ptx) not used", err)


if __name__ == "__main__":
    support.main()
