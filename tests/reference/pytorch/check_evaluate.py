#!/usr/bin/env python3
"""The numbers of `vsplat evaluate` against the specification's: everything but the network's forward is done again here, from the files
and from the Gaussians that the network made. run.sh runs it; $VSPLAT is the command."""
import json
import math
import os
import sys

import torch

import loss_reference
import object_views
import safetensors_file
import splat3d_reference as splat3d


sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "cli"))
import support  # noqa: E402: found by the line above


def kmeans(positions, k):
    """-> groups of indices, as model/views/view_choice.h has them: farthest first from 0, Lloyd's steps, ties to the lower index, by lowest member."""
    far = lambda i, chosen: min(math.dist(positions[i], positions[c]) for c in chosen)
    seeds = [0]
    while len(seeds) < k:
        seeds.append(max(range(len(positions)), key=lambda i: (far(i, seeds), -i)))
    means, before = [positions[s] for s in seeds], None
    while True:
        of = [min(range(len(means)), key=lambda g: (math.dist(p, means[g]), g)) for p in positions]
        if of == before:
            return sorted([[i for i, o in enumerate(of) if o == g] for g in range(len(means))])
        before = of
        for g in range(len(means)):
            members = [p for p, o in zip(positions, of) if o == g]
            means[g] = [sum(v) / len(members) for v in zip(*members)]


class EvaluateNumbers(support.Case):
    def setUp(self):
        super().setUp()
        self.set = self.path("set")
        self.succeeds("dataset", "procedural", "--count", 3, "--solids", "--output", self.set, "--views", 11, "--size", self.SIDE, "--seed", 4)

    def test_numbers_are_the_specifications(self):
        """Everything but the network's forward, from the files and the network's Gaussians, by the specification in PyTorch."""
        report = json.loads(self.succeeds("evaluate", self.set, "--model", self.model, "--json")[0])
        for row in report["objects"]:
            folder = os.path.join(self.set, row["name"])
            with open(os.path.join(folder, "transforms.json")) as f:
                listed = json.load(f)
            c2w = torch.tensor([f["transform_matrix"] for f in listed["frames"]], dtype=torch.float64) @ torch.diag(torch.tensor([1., -1, -1, 1])).double()
            groups = kmeans([m[:3, 3].tolist() for m in c2w], 2), kmeans([m[:3, 3].tolist() for m in c2w], 4)
            inputs = [g[0] for g in groups[0]]
            novel = [g[-1] for g in groups[1] if g[-1] not in inputs]
            self.assertGreaterEqual(len(novel), 2)
            self.succeeds("reconstruct", folder, "--model", self.model, "--views", ",".join(f"@{i}" for i in inputs), "--output", self.path("o.ply"),
                          "--dump", self.path("dump"), "--overwrite")
            dump, _ = safetensors_file.load_safetensors(self.path("dump", "stages.safetensors"))
            placed = object_views.rebase(object_views.place(c2w[inputs + novel], (0, 0, 0), 1.0))
            focal = listed.get("fl_x") or 0.5 * self.SIDE / math.tan(listed["camera_angle_x"] / 2)
            K = torch.tensor([[focal, 0, self.SIDE / 2], [0, focal, self.SIDE / 2], [0, 0, 1]], dtype=torch.float64)

            def picture(i):
                width, height, data = support.read_png(os.path.join(folder, listed["frames"][i]["file_path"]))
                rgba = torch.tensor(list(data), dtype=torch.float64).reshape(height, width, 4) / 255
                return rgba[..., :3] * rgba[..., 3:] + 1 - rgba[..., 3:]

            def drawn(level):
                g = splat3d.Gaussians(*[dump[f"stage.{level}.{f}"].double() for f in splat3d.GAUSSIAN_FIELDS])
                return torch.cat([splat3d.render(g, c, K, self.SIDE, self.SIDE, torch.ones(3).double())[0] for c in placed[len(inputs):]], 1).clamp(0, 1)

            def nearest(i):
                towards = c2w[i, :3, 3] / c2w[i, :3, 3].norm()
                return max(inputs, key=lambda j: float(c2w[j, :3, 3] / c2w[j, :3, 3].norm() @ towards))

            truth, result = torch.cat([picture(i) for i in novel], 1), drawn("final")
            want = {"psnr": loss_reference.psnr(result, truth), "psnr_coarse": loss_reference.psnr(drawn("coarse"), truth), "ssim": loss_reference.ssim(result[None], truth[None]),
                    "psnr_white": loss_reference.psnr(torch.ones_like(truth), truth),
                    "psnr_nearest": loss_reference.psnr(torch.cat([picture(nearest(i)) for i in novel], 1), truth),
                    "selected": len(dump["stage.coords"]) / 64}
            for name, value in want.items():
                self.assertAlmostEqual(row[name], float(value), delta=1e-4 * max(1, abs(float(value))), msg=f"{row['name']} {name}")


if __name__ == "__main__":
    torch.set_num_threads(1)
    support.main()
