"""3D Gaussian splatting: the Gaussians, and the renderer that the OpenCL kernels are compared with. Conventions as in
vsplat_reference.py."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F

SH_C0 = 0.28209479177387814
SH_C1 = 0.4886025119029199
# The rasteriser's thresholds are float32 numbers; in float64 (1 - 0.99)^2 would not fall under 1e-4.
MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE = (float(np.float32(v)) for v in (0.99, 1 / 255, 1e-4))


@dataclass
class Gaussians:
    """K primitives in render units: metres-like scales, unit quaternions wxyz,
    opacities in [0,1], SH (K,S,3) with colour = SH basis . sh + 0.5."""
    means: torch.Tensor
    scales: torch.Tensor
    quats: torch.Tensor
    opacities: torch.Tensor
    sh: torch.Tensor

    def fields(self):
        return [getattr(self, f) for f in GAUSSIAN_FIELDS]


GAUSSIAN_FIELDS = ("means", "scales", "quats", "opacities", "sh")


def rotation(q):
    w, x, y, z = F.normalize(q, dim=-1).unbind(-1)
    return torch.stack([
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1).reshape(-1, 3, 3)


def sh_basis(d, count):
    """Real spherical harmonics with the Condon-Shortley sign, as every 3DGS file stores them:
    unit directions (K,3) -> (K,count), count 1, 4, 9 or 16."""
    x, y, z = d.unbind(-1)
    b = [torch.full_like(x, SH_C0)]
    if count > 1:
        b += [-SH_C1 * y, SH_C1 * z, -SH_C1 * x]
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        b += [1.0925484305920792 * x * y, -1.0925484305920792 * y * z, 0.31539156525252005 * (2 * zz - xx - yy),
              -1.0925484305920792 * x * z, 0.5462742152960396 * (xx - yy)]
    if count > 9:
        b += [-0.5900435899266435 * y * (3 * xx - yy), 2.890611442640554 * x * y * z, -0.4570457994644658 * y * (4 * zz - xx - yy),
              0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy), -0.4570457994644658 * x * (4 * zz - xx - yy),
              1.445305721320277 * z * (xx - yy), -0.5900435899266435 * x * (xx - 3 * yy)]
    return torch.stack(b, -1)


def compensation(S, det):
    """sqrt(det(S S^T) / det), with S (K,2,3) and det (K,) of S S^T + 0.3 I; det(S S^T) is the square of its rows' cross product."""
    return torch.sqrt(torch.linalg.cross(S[:, 0], S[:, 1]).square().sum(-1) / det)


def render(g: Gaussians, c2w, K, width, height, background, near=0.2, mirror=None, chunk=4096, antialias=False):
    """3D Gaussian splatting as in the original CUDA rasteriser, without tiles: every pixel
    composites every Gaussian, near to far. -> image (H,W,3), alpha (H,W), depth (H,W).

    Details that matter for equality: depth sort by camera z (stable); culled when z <= near;
    x/z and y/z clamped to 1.3 tan(fov/2) in the Jacobian only; 0.3 px added to the diagonal of
    the 2D covariance; a Gaussian reaches only pixels inside the square of 16x16 tiles that its
    3-sigma radius touches; alpha = min(0.99, o exp(power)), skipped below 1/255 or when
    power > 0; a pixel stops before the Gaussian that would bring transmittance under 1e-4;
    colour is not clamped above; depth is the sum of weight x camera z, not divided by alpha.
    Gradients are the true derivatives (autograd), also where the CUDA code's differ.

    `mirror` (3,): colours as seen from the camera's mirror image about this point, see `negate_camera_centre`.
    `antialias`: opacities are multiplied by `compensation`, as in Mip-Splatting."""
    dev = g.means
    w2c = torch.inverse(c2w)
    W, t = w2c[:3, :3], w2c[:3, 3]
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    cam = g.means @ W.T + t
    order = torch.argsort(cam[:, 2].detach(), stable=True)
    order = order[cam[order, 2] > near]
    cam, mean = cam[order], g.means[order]
    x, y, z = cam.unbind(-1)
    u, v = fx * x / z + cx, fy * y / z + cy                      # in pixels, centre of pixel (0,0) at 0.5
    limx, limy = 1.3 * width / (2 * fx), 1.3 * height / (2 * fy)
    tx, ty = z * torch.clamp(x / z, -limx, limx), z * torch.clamp(y / z, -limy, limy)
    zero = torch.zeros_like(z)
    J = torch.stack([fx / z, zero, -fx * tx / (z * z), zero, fy / z, -fy * ty / (z * z)], -1).reshape(-1, 2, 3)
    M = rotation(g.quats[order]) * g.scales[order][:, None, :]
    S = J @ W @ M
    cov = S @ S.transpose(1, 2)
    a, b, c = cov[:, 0, 0] + 0.3, cov[:, 0, 1], cov[:, 1, 1] + 0.3
    det = a * c - b * b
    mid = 0.5 * (a + c)
    radius = torch.ceil(3 * torch.sqrt(mid + torch.sqrt(torch.clamp(mid * mid - det, min=0.1)))).detach()
    centre = c2w[:3, 3] if mirror is None else 2 * torch.as_tensor(mirror).to(c2w) - c2w[:3, 3]
    sh = g.sh[order]
    basis = sh_basis(F.normalize(mean - centre, dim=-1), sh.shape[1])
    colour = torch.clamp((basis[..., None] * sh).sum(1) + 0.5, min=0)
    op = g.opacities[order] * (compensation(S, det) if antialias else 1)
    # the CUDA code measures pixels from their integer index: u - 0.5 there equals u here
    ud, vd = u.detach() - 0.5, v.detach() - 0.5
    tiles_x, tiles_y = (width + 15) // 16, (height + 15) // 16
    x0 = torch.clamp(torch.trunc((ud - radius) / 16), 0, tiles_x); x1 = torch.clamp(torch.trunc((ud + radius + 15) / 16), 0, tiles_x)
    y0 = torch.clamp(torch.trunc((vd - radius) / 16), 0, tiles_y); y1 = torch.clamp(torch.trunc((vd + radius + 15) / 16), 0, tiles_y)
    yy, xx = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    px, py = xx.reshape(-1), yy.reshape(-1)
    out, alphas, depths = [], [], []
    for s in range(0, len(px), chunk):
        ix, iy = px[s:s + chunk], py[s:s + chunk]
        dx = u[None] - (ix[:, None].to(dev) + 0.5)
        dy = v[None] - (iy[:, None].to(dev) + 0.5)
        power = -0.5 * (c * dx * dx + a * dy * dy) / det + b * dx * dy / det
        tx_, ty_ = (ix // 16)[:, None], (iy // 16)[:, None]
        inside = (tx_ >= x0) & (tx_ < x1) & (ty_ >= y0) & (ty_ < y1)
        alpha = torch.clamp(op * torch.exp(torch.clamp(power, max=0)), max=MAX_ALPHA)
        alpha = torch.where(inside & (power <= 0) & (alpha >= MIN_ALPHA), alpha, torch.zeros_like(alpha))
        T = torch.cumprod(1 - alpha, 1)
        before = torch.cat([torch.ones_like(T[:, :1]), T[:, :-1]], 1)
        live = (T >= MIN_TRANSMITTANCE).to(dev)                               # T only falls, so this is a prefix
        w = before * alpha * live
        left = 1 - w.sum(1)
        out.append(w @ colour + left[:, None] * background)
        alphas.append(w.sum(1)); depths.append(w @ z)
    shape = (height, width)
    return torch.cat(out).reshape(*shape, 3), torch.cat(alphas).reshape(shape), torch.cat(depths).reshape(shape)
