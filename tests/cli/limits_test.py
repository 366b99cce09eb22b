"""VSPLAT_LIMITS: whole jobs under the limits of smaller devices, in both flavours, compared with runs without limits; and no planned launch
is longer than a device should run at once."""
import csv
import json
import os
import struct

import support
import train_support


def floats_of(path):
    """Returns the floats of a PLY as this command writes it: everything after its header."""
    with open(path, "rb") as f:
        data = f.read()
    data = data[data.index(b"end_header\n") + 11:]
    return struct.unpack(f"<{len(data) // 4}f", data[:len(data) // 4 * 4])


class Limits(train_support.Case):
    SIDE = 24

    def setUp(self):
        super().setUp()
        code, _, err = support.run("init", "micro", "--seed", 3, "--output", self.path("model.safetensors"), "--quiet")
        self.assertEqual(code, 0, err)
        self.model, self.views = self.path("model.safetensors"), self.make_views(count=4)
        self.ball = self.path("ball.ply")
        spots = [(0.2 * (i % 5) - 0.4, 0.2 * (i // 5 % 5) - 0.4, 0.2 * (i // 25) - 0.4) for i in range(125)]
        support.write_scene(self.ball, [(at, (0.5, 0.4, 0.3), 0.06, 0.7) for at in spots])

    def jobs(self, kernels, name, limits):
        """Runs every job once, into a folder of that name. Returns the line about the device."""
        env, out = {"VSPLAT_LIMITS": limits, "VSPLAT_KERNELS": kernels}, lambda *parts: self.path(f"{name}_{kernels}", *parts)
        os.makedirs(out())
        _, err = self.succeeds("reconstruct", self.views, "--model", self.model, "--output", out("scene.ply"), "--render", "orbit:2",
                               "--images", out("pictures"), "--size", "70x45", env=env)
        self.succeeds("fit", self.views, "--start", self.ball, "--output", out("refined.ply"), "--holdout", 1, "--steps", 3,
                      "--log", out("refined.csv"), "--quiet", env=env)
        config = self.config(f"{name}_{kernels}.json", steps=2, warmup=1)
        self.succeeds("train", config, "--data", self.solids, "--output", out("run"), "--quiet", env=env)
        return err

    def files(self, folder):
        out = {}
        for name in ("scene.ply", "pictures/0000.png", "pictures/0001.png", "refined.ply", "run/model.safetensors"):
            out[name] = self.read(folder, *name.split("/"))
        return out

    def both(self, limits, same_bits):
        for kernels in ("cpu", "gpu"):
            self.assertNotIn("VSPLAT_LIMITS", self.jobs(kernels, "whole", ""))
            self.assertIn(f"lowered by VSPLAT_LIMITS={limits}", self.jobs(kernels, "less", limits))
            whole, less = f"whole_{kernels}", f"less_{kernels}"
            if same_bits:
                for name, data in self.files(whole).items():
                    self.assertEqual(data, self.files(less)[name], f"{name}, {kernels} kernels")
            else:
                self.assert_close(whole, less)

    def assert_close(self, whole, less):
        """Sums may be computed in another order, within the tolerances. Steps of an optimiser follow the sign of values that may be almost zero,
        so a trained model is compared by its losses."""
        a, b = (floats_of(self.path(name, "scene.ply")) for name in (whole, less))
        self.assertEqual(len(a), len(b))
        most = max(map(abs, a))
        self.assertLess(max(abs(x - y) for x, y in zip(a, b)), 1e-4 * most)
        for i in range(2):
            first, second = (support.read_png(self.path(name, "pictures", f"{i:04d}.png")) for name in (whole, less))
            self.assertLessEqual(max(abs(x - y) for x, y in zip(first[2], second[2])), 1)
        losses = [self.losses(name) for name in (whole, less)]
        self.assertEqual(len(losses[0]), 5)
        for x, y in zip(*losses):
            self.assertLess(abs(x - y), 1e-4 * abs(x))

    def losses(self, folder):
        with open(self.path(folder, "refined.csv")) as f:
            refined = [float(row["loss"]) for row in csv.DictReader(f)]
        return [float(line["loss"]) for line in self.log(os.path.join(folder, "run"))] + refined

    def test_groups_of_128(self):
        self.both("group=128", False)

    def test_groups_of_64(self):
        self.both("group=64", False)

    def test_local_memory_of_32k(self):
        self.both("local=32K", False)

    def test_local_memory_of_16k(self):
        self.both("local=16K", False)

    def test_small_buffers(self):
        self.both("buffer=2M,memory=2G", True)  # a large device has 128M, which no micro model comes near
        needs = ("reconstruct", self.views, "--model", self.model, "--output", self.path("no.ply"))
        self.refuses(1, ["not enough device memory", "in one buffer"], *needs, env={"VSPLAT_LIMITS": "buffer=4K"})
        self.refuses(1, ["not enough device memory"], *needs, env={"VSPLAT_LIMITS": "memory=64K"})

    def test_no_doubles(self):
        self.both("fp64=0,fp16=0,subgroups=0", True)

    def test_wide_alignment(self):
        self.both("align=4096", True)

    def test_sizes_of_32_bits(self):
        self.both("size=32", True)

    def test_parts(self):
        self.both("flops=1e5", True)

    def test_few_groups_a_side(self):
        self.both("grid=3", True)

    def test_bad_limits(self):
        self.refuses(2, ["VSPLAT_LIMITS", "\"groups=3\"", "no such limit"], *self.reconstruct(), env={"VSPLAT_LIMITS": "groups=3"})
        self.refuses(2, ["VSPLAT_LIMITS", "\"fp64=1\"", "raises"], "devices", env={"VSPLAT_LIMITS": "fp64=1"})
        self.refuses(1, ["work-groups of 32 items", "at least 64"], *self.reconstruct(), env={"VSPLAT_LIMITS": "group=32"})
        self.refuses(1, ["8192 bytes of local memory"], *self.reconstruct(), env={"VSPLAT_LIMITS": "local=8K"})
        out, _ = self.succeeds("devices", "--json", env={"VSPLAT_LIMITS": "group=100,local=20K"})
        for device in json.loads(out):
            self.assertEqual((device["max_work_group"], device["local_memory"], device["limits"]), (100, 20480, "group=100,local=20K"))


class Planned(support.Case):
    def kernels(self, model, *more, env=None):
        listed = json.loads(self.succeeds("kernels", "--model", model, "--flavour", "all", "--no-build", "--json", "--quiet", *more, env=env)[0])
        return [(program["flavour"], kernel) for program in listed for kernel in program["about"] if kernel["launches"]]

    def test_no_launch_is_too_long(self):
        """Plans at the paper's size, forward; a training step of the small model; drawing and fitting at the sizes that `kernels` plans with."""
        for name, jobs in (("paper", "reconstruct,render,fit"), ("small", "train")):
            model = self.path(name + ".safetensors")
            self.succeeds("init", name, "--seed", 1, "--output", model, "--quiet")
            kernels = self.kernels(model, "--for", jobs)
            os.remove(model)
            self.assertGreater(len(kernels), 50)
            long = [f"{flavour} {k['name']}: {k['longest']:.3g}" for flavour, k in kernels if k["longest"] > 2e10]
            self.assertEqual(long, [], name)
            wide = [f"{flavour} {k['name']}: {k['most_groups']}" for flavour, k in kernels if k["most_groups"] > 65535]
            self.assertEqual(wide, [], name)
            self.assertGreater(max(k["longest"] for _, k in kernels), 1e9)  # so it is measured

    def test_local_memory_and_groups_fit(self):
        """The local memory that kernels declare, as compiled, on a device with little of it."""
        for kernel in (k for _, k in self.kernels(self.model, env={"VSPLAT_LIMITS": "group=64,local=16K"})):
            for launch in kernel["launches"]:
                if launch["group"]:
                    self.assertLessEqual(launch["group"][0] * launch["group"][1] * launch["group"][2], 64, kernel["name"])


if __name__ == "__main__":
    support.main()
