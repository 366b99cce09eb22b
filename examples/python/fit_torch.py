"""Fits Gaussians to a picture with PyTorch's optimiser and vsplat's drawing:  fit_torch.py [STEPS [PICTURE.npy]]

`Draw` is all that PyTorch needs: a torch.autograd.Function around Device.render. It runs on any OpenCL device; PyTorch's own tensors stay on
the host."""
import sys

import numpy as np
import torch

import vsplat


class Draw(torch.autograd.Function):
    """(means [K,3], scales [K,3], rotations [K,4], opacities [K], sh [K,S,3]) -> colour [H,W,3], alpha [H,W], depth [H,W]"""

    @staticmethod
    def forward(ctx, device, camera, background, means, scales, rotations, opacities, sh):
        arrays = [t.detach().cpu().float().numpy() for t in (means, scales, rotations, opacities, sh)]
        ctx.device, ctx.camera, ctx.background = device, camera, background
        ctx.scene = vsplat.Scene.from_arrays(*arrays)
        ctx.dtype, ctx.place = means.dtype, means.device
        picture = device.render(ctx.scene, camera, background, supersample=1)
        return tuple(torch.from_numpy(a).to(means) for a in (picture.colour, picture.alpha, picture.depth))

    @staticmethod
    def backward(ctx, colour, alpha, depth):
        by = [g.detach().cpu().float().numpy() for g in (colour, alpha, depth)]
        g, _ = ctx.device.render_backward(ctx.scene, ctx.camera, *by, background=ctx.background)
        arrays = (g.means, g.scales, g.rotations, g.opacities, g.sh)
        return None, None, None, *(torch.from_numpy(a).to(device=ctx.place, dtype=ctx.dtype) for a in arrays)


def draw(device, camera, means, scales, rotations, opacities, sh, background=(1, 1, 1)):
    """Returns the three pictures of Draw."""
    return Draw.apply(device, camera, background, means, scales, rotations, opacities, sh)


def two_discs(size):
    """Returns a picture to fit: a red disc and a blue one on white, float32 [size, size, 3]."""
    y, x = np.mgrid[:size, :size] / size
    out = np.ones((size, size, 3), np.float32)
    out[(x - 0.35) ** 2 + (y - 0.4) ** 2 < 0.04] = 0.9, 0.2, 0.1
    out[(x - 0.65) ** 2 + (y - 0.6) ** 2 < 0.03] = 0.1, 0.3, 0.8
    return out


def main(steps=200, path=None):
    target = torch.from_numpy(np.load(path).astype(np.float32) if path else two_discs(64))
    height, width, _ = target.shape
    device = vsplat.Device()
    camera = vsplat.Camera(width, height, width, width, width / 2, height / 2)
    camera.w2c[2, 3] = 2
    torch.manual_seed(0)
    count = 300
    means = torch.rand(count, 3) * 1.6 - 0.8
    log_scales, rotations = torch.full((count, 3), -2.8), torch.randn(count, 4)
    logits, sh = torch.zeros(count), torch.zeros(count, 1, 3)
    parameters = [means, log_scales, rotations, logits, sh]
    optimizer = torch.optim.Adam([p.requires_grad_() for p in parameters], lr=0.03)
    for step in range(steps):
        colour, _, _ = draw(device, camera, means, log_scales.exp(), rotations, torch.sigmoid(logits), sh)
        loss = (colour - target).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if step % 20 == 0 or step + 1 == steps:
            print(f"step {step + 1}: {-10 * np.log10(loss.item()):.2f} dB")
    return loss.item()


if __name__ == "__main__":
    main(*(int(a) if i == 0 else a for i, a in enumerate(sys.argv[1:])))
