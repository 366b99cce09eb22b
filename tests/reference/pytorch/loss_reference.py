"""Losses and metrics of pictures: SSIM, MS-SSIM, PSNR, and the loss of a training."""
import torch
import torch.nn.functional as F


def _window(size=11, sigma=1.5):
    x = torch.arange(size, dtype=torch.float64) - size // 2
    g = torch.exp(-x * x / (2 * sigma * sigma))
    return g / g.sum()


def _ssim_maps(a, b):
    """(N,3,H,W) in [0,1] -> SSIM and contrast-structure, means over pixels (N,3). Valid windows only."""
    w = _window().to(a)
    blur = lambda x: F.conv2d(F.conv2d(x, w.reshape(1, 1, -1, 1).expand(3, 1, -1, 1), groups=3),
                              w.reshape(1, 1, 1, -1).expand(3, 1, 1, -1), groups=3)
    c1, c2 = 0.01 ** 2, 0.03 ** 2
    ma, mb = blur(a), blur(b)
    va, vb, cab = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    cs = (2 * cab + c2) / (va + vb + c2)
    return ((2 * ma * mb + c1) / (ma * ma + mb * mb + c1) * cs).mean((2, 3)), cs.mean((2, 3))


def ssim(a, b):
    """(N,H,W,3) -> scalar."""
    return _ssim_maps(a.permute(0, 3, 1, 2), b.permute(0, 3, 1, 2))[0].mean()


def ms_ssim(a, b, weights=(0.0448, 0.2856, 0.3001, 0.2363, 0.1333)):
    """Five scales; both sides must exceed 160 pixels."""
    a, b = a.permute(0, 3, 1, 2), b.permute(0, 3, 1, 2)
    vals = []
    for i in range(len(weights)):
        s, cs = _ssim_maps(a, b)
        vals.append(F.relu(s if i + 1 == len(weights) else cs))
        if i + 1 < len(weights):
            pad = [a.shape[2] % 2, a.shape[3] % 2]
            a, b = F.avg_pool2d(a, 2, padding=pad), F.avg_pool2d(b, 2, padding=pad)
    return torch.prod(torch.stack(vals) ** torch.tensor(weights).to(a).reshape(-1, 1, 1), 0).mean()


def psnr(a, b):
    return -10 * torch.log10(((a - b) ** 2).mean())


def loss(coarse, final, target, ssim_weight=0.5):
    """(N,H,W,3) each; `final` None where the model has one level only. Pictures are clamped to [0,1], then
    MSE + w (1 - SSIM), summed over the levels; MS-SSIM where the image allows it."""
    s = ms_ssim if min(target.shape[1:3]) > 160 else ssim
    pictures = [x.clamp(0, 1) for x in (coarse, final) if x is not None]
    return sum(((x - target) ** 2).mean() + ssim_weight * (1 - s(x, target)) for x in pictures)
