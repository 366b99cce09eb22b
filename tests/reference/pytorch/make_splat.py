"""Write the scenes that drawing and its derivative are held against, one file each: what `render` of the specification
makes of them in float64, and what autograd then says.

    python3 make_splat.py DIR small        the committed ones
    python3 make_splat.py DIR large        those that are made when they are needed

Tensors, float32 (the inputs are read exactly): K Gaussians, S coefficients, V cameras of H x W pixels.
    input.{means,scales,quats,opacities,sh}   [K,3] [K,3] [K,4] [K] [K,S,3]; quats of any length
    input.w2c [V,4,4], input.intrinsics [V,4] (fx fy cx cy), input.background [3], input.near [1], and, where the scene
    has it, input.mirror [3] and input.antialias [1]
    picture.{colour,alpha,depth}              [V,H,W,3] [V,H,W] [V,H,W]
    cotangent.{colour,alpha,depth}            random, as the pictures
    grad.{means,scales,quats,opacities,sh}    of the sum over cameras and pictures of cotangent . picture
    grad.pose [V,6]                           at 0 of xi = (omega, tau), where w2c is replaced by exp([omega, tau]) w2c
Metadata: count, degree, views, width, height.

No scene has a value near a place where the picture jumps or its derivative does: see `offenders`. Gaussians that come
near one are drawn again until none does.
"""
import glob
import os
import sys

import numpy as np
import torch

import safetensors_file
import splat3d_reference as splat3d
from bench_scenes import look_at

# Gaussians, SH degree, width, height, cameras, what is special
SMALL = {
    "one": (1, 0, 33, 17, 1, ""),
    "seventeen": (17, 1, 37, 21, 2, "off-centre"),
    "degree2": (40, 2, 30, 30, 1, "discs"),
    "degree3": (60, 3, 32, 20, 1, ""),
    "needles": (40, 3, 48, 30, 1, "needles"),
    "mirror": (50, 3, 20, 20, 1, "mirror"),
    "near": (100, 1, 34, 30, 1, "near-exact"),
    "extremes": (60, 1, 32, 32, 1, "opacity"),
    "clamped": (40, 1, 32, 32, 1, "clamped"),
    "stops": (150, 0, 24, 20, 1, "stops"),
    "wide": (12, 1, 50, 10, 1, "wide"),
    "one_pixel": (50, 1, 1, 1, 2, ""),
    "empty": (0, 1, 19, 7, 1, ""),
    "antialias": (70, 2, 37, 21, 2, "small antialias"),
    "antialias_needles": (40, 1, 40, 30, 1, "needles antialias"),
}
LARGE = {
    "plain": (500, 1, 96, 80, 2, ""),
    "lengths": (300, 2, 61, 97, 2, "off-centre lengths"),
    "around": (400, 1, 64, 64, 2, "near"),
    "many_needles": (200, 3, 96, 96, 1, "needles"),
    "many_discs": (100, 3, 80, 72, 1, "discs"),
    "large": (12, 1, 200, 40, 1, "large"),
    "dense": (1000, 0, 48, 33, 1, "stops"),
    "many": (5000, 3, 72, 56, 1, "small"),
}

single = lambda x: np.asarray(x, np.float32).astype(np.float64)
widen = lambda x: torch.tensor(single(x))


def draw(rng, count, degree, kind):
    """Columns of `count` random Gaussians, float32 values."""
    scale = {"large": 0.9, "wide": 0.3, "small": 0.015, "opacity": 0.09, "clamped": 0.2, "stops": 0.08}.get(kind, 0.03)
    reach = 2 if "near" in kind else 0.4 if kind == "stops" else 0.5
    means = rng.uniform(-reach, reach, (count, 3))
    scales = scale * np.exp(rng.normal(0, 0.6, (count, 3)))
    if kind in ("needles", "discs"):
        scales = np.tile(0.2 * np.array([1, 1e-3, 1e-3] if kind == "needles" else [1, 1, 1e-3]), (count, 1))
    # Where Gaussians fill the picture, transmittance has whole contours on which it passes 1e-4: there it must not come that far.
    opacities = rng.uniform(0.4 if kind == "stops" else 0.05, 0.5 if kind in ("large", "wide") else 0.95, count)
    if kind == "opacity":
        opacities = rng.choice([0, 1e-6, 1 / 256, 0.5, 0.989, 0.991, 1 - 1e-6, 1], count)
    if kind == "clamped":
        opacities = rng.choice([0.985, 0.991, 0.999, 1], count)
    if kind == "near-exact":
        # The camera is at the origin and not turned, so z is what is written here: at the near plane (left out), one rounding before it
        # (left out) and behind it (drawn), several equal (they blend in the order of the file), and on both sides at random.
        near = np.float32(0.2)
        exact = np.array([near, np.nextafter(near, np.float32(0)), np.nextafter(near, np.float32(1)), -1, 0, 1.25])
        means[:, 2] = np.where(rng.random(count) < 0.5, rng.choice(exact, count), rng.uniform(0.21, 2.5, count))
        means[:, :2] *= 0.35 * np.abs(means[:, 2:]) + 0.02
        scales *= np.maximum(np.abs(means[:, 2:]), 0.1)
    quats = rng.normal(size=(count, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    if "lengths" in kind:
        quats *= rng.uniform(0.3, 3, (count, 1))
    sh = rng.normal(0, 0.5, (count, (degree + 1) ** 2, 3))
    return [single(x) for x in (means, scales, quats, opacities, sh)]


def cameras(rng, views, width, height, kind):
    """w2c (V,4,4), intrinsics (V,4)."""
    poses, lenses = [], []
    for _ in range(views):
        eye = rng.normal(size=3)
        eye *= 1.5 / np.linalg.norm(eye)
        poses.append(np.eye(4) if kind == "near-exact" else look_at(eye, np.zeros(3), np.array([0.1, 1, 0.2])))
        f = 0.9 * max(width, height)
        centre = (width * 0.1, height * 1.2) if "off-centre" in kind else (width / 2, height / 2)
        lenses.append((f, f * (1.3 if "off-centre" in kind else 1), *centre))
    return widen(poses), widen(lenses)


def offenders(g, w2c, lens, width, height, near, mirror, antialias):
    """Which Gaussians (K,) come so near a jump or a kink that float32 may well fall on its other side: alpha within 1e-4 of 1/255 or
    0.99, transmittance within 1e-3 of 1e-4, camera z within 1e-4 of the near plane or within 2e-6 of another's (unless
    exactly there), the 3-sigma square within 1e-3 pixels of gaining a pixel or a tile, x/z or y/z within 1e-4 of
    their limit, a colour within 1e-4 of its limit 0. The pictures' own function tells none of these, so they are computed once more."""
    bad = torch.zeros(len(g.means), dtype=torch.bool)
    fx, fy, cx, cy = lens
    W = w2c[:3, :3]
    cam = g.means @ W.T + w2c[:3, 3]
    z = cam[:, 2]
    bad |= ((z - near).abs() < 1e-4) & ((z - near).abs() > 1e-7)
    order = torch.argsort(z, stable=True)
    order = order[z[order] > near]
    if len(order) == 0:
        return bad
    x, y, z = cam[order].unbind(-1)
    gap = (z[1:] - z[:-1]) / z[1:]
    bad[order[1:][(gap < 2e-6) & (gap > 0)]] = True
    zero = torch.zeros_like(z)
    tangents = []
    for value, limit in ((x / z, 1.3 * width / (2 * fx)), (y / z, 1.3 * height / (2 * fy))):
        bad[order[(value.abs() / limit - 1).abs() < 1e-4]] = True
        tangents.append(value.clamp(-limit, limit))
    J = torch.stack([fx / z, zero, -fx * tangents[0] / z, zero, fy / z, -fy * tangents[1] / z], -1).reshape(-1, 2, 3)
    S = J @ W @ (splat3d.rotation(g.quats[order]) * g.scales[order][:, None, :])
    cov = S @ S.transpose(1, 2) + 0.3 * torch.eye(2, dtype=z.dtype)
    conic = torch.inverse(cov)
    mid, det = (cov[:, 0, 0] + cov[:, 1, 1]) / 2, torch.det(cov)
    opacities = g.opacities[order] * (splat3d.compensation(S, det) if antialias else 1)
    three_sigma = 3 * torch.sqrt(mid + torch.sqrt((mid * mid - det).clamp(min=0.1)))
    bad[order[((three_sigma - three_sigma.round()).abs() / three_sigma.clamp(min=1) < 1e-5)]] = True
    centre = torch.stack([fx * x / z + cx, fy * y / z + cy], -1)
    tiles = torch.tensor([(width + 15) // 16, (height + 15) // 16])
    radius = three_sigma.ceil()[:, None]
    low, high = (centre - 0.5 - radius) / 16, (centre - 0.5 + radius + 15) / 16
    for edge in (low, high):
        at_tile = ((edge - edge.round()).abs() < 1e-3 / 16) & (edge.round() > 0) & (edge.round() <= tiles)
        bad[order[at_tile.any(1)]] = True
    low, high = (torch.minimum(e.trunc().clamp(min=0), tiles) for e in (low, high))

    eye = torch.inverse(w2c)[:3, 3]
    eye = eye if mirror is None else 2 * mirror - eye
    basis = splat3d.sh_basis(torch.nn.functional.normalize(g.means[order] - eye, dim=-1), g.sh.shape[1])
    colour = (basis[..., None] * g.sh[order]).sum(1) + 0.5
    bad[order[(colour.abs() < 1e-4).any(1)]] = True

    for row in range(height):
        pixel = torch.stack([torch.arange(width) + 0.5, torch.full((width,), row + 0.5)], -1).double()
        d = pixel[:, None] - centre[None]
        alpha = opacities * torch.exp(-0.5 * torch.einsum("pki,kij,pkj->pk", d, conic, d))
        tile = torch.stack([torch.arange(width) // 16, torch.full((width,), row // 16)], -1)[:, None]
        alpha = torch.where(((tile >= low) & (tile < high)).all(-1), alpha, torch.zeros_like(alpha))
        close = ((alpha / splat3d.MIN_ALPHA - 1).abs() < 1e-4) | ((alpha / splat3d.MAX_ALPHA - 1).abs() < 1e-4)
        alpha = torch.where(alpha >= splat3d.MIN_ALPHA, alpha, torch.zeros_like(alpha)).clamp(max=splat3d.MAX_ALPHA)
        T = torch.cumprod(1 - alpha, 1)
        reached = torch.cat([torch.ones_like(T[:, :1]), T[:, :-1]], 1) >= splat3d.MIN_TRANSMITTANCE * 0.99
        close = reached & (close | (((T / splat3d.MIN_TRANSMITTANCE - 1).abs() < 1e-3) & (alpha > 0)))
        bad[order[close.any(0)]] = True
    return bad


def settled_scene(name, shape):
    """Gaussians, w2c, intrinsics, near, mirror, antialias."""
    count, degree, width, height, views, kind = shape
    antialias, kind = "antialias" in kind, kind.removesuffix(" antialias")
    rng = np.random.default_rng([*name.encode()])
    w2c, lens = cameras(rng, views, width, height, kind)
    near = float(np.float32(0.2))
    mirror = widen([0.1, -0.2, 0.3]) if kind == "mirror" else None
    columns = draw(rng, count, degree, kind)
    for _ in range(1000):
        g = splat3d.Gaussians(*[torch.tensor(c) for c in columns])
        bad = torch.zeros(count, dtype=torch.bool)
        for v in range(views):
            bad |= offenders(g, w2c[v], lens[v], width, height, near, mirror, antialias)
        if not bad.any():
            return g, w2c, lens, near, mirror, antialias
        again = draw(rng, int(bad.sum()), degree, kind)
        for c, fresh in zip(columns, again):
            c[bad.numpy()] = fresh
    raise SystemExit(f"{name}: no scene clear of the thresholds found in 1000 attempts")


def hat(xi):
    """The 4x4 generator of the motion (omega, tau)."""
    o, zero = xi[:3], torch.zeros_like(xi[0])
    return torch.stack([zero, -o[2], o[1], xi[3], o[2], zero, -o[0], xi[4], -o[1], o[0], zero, xi[5], zero, zero, zero, zero]).reshape(4, 4)


def pictures(g, w2c, lens, width, height, background, near, mirror, antialias):
    fx, fy, cx, cy = lens
    K = torch.tensor([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=torch.float64)
    return splat3d.render(g, torch.inverse(w2c), K, width, height, background, near, mirror, 1024, antialias)


def case(name, shape):
    count, degree, width, height, views, kind = shape
    g, w2c, lens, near, mirror, antialias = settled_scene(name, shape)
    torch.manual_seed(sum(name.encode()))
    background = widen([1.0, 0.5, 0.25])
    for field in g.fields():
        field.requires_grad_(True)
    out = {f"input.{f}": x.detach() for f, x in zip(splat3d.GAUSSIAN_FIELDS, g.fields())}
    out.update({"input.w2c": w2c, "input.intrinsics": lens, "input.background": background, "input.near": torch.tensor([near])})
    if mirror is not None:
        out["input.mirror"] = mirror
    if antialias:
        out["input.antialias"] = torch.ones(1)
    shots, cotangents, pose_gradients = [], [], []
    for v in range(views):
        xi = torch.zeros(6, dtype=torch.float64, requires_grad=True)
        shot = pictures(g, torch.matrix_exp(hat(xi)) @ w2c[v], lens[v], width, height, background, near, mirror, antialias)
        cotangent = [widen(torch.randn_like(x)) for x in shot]
        loss = sum((c * x).sum() for c, x in zip(cotangent, shot))
        if loss.requires_grad:
            loss.backward()
        shots.append([x.detach() for x in shot])
        cotangents.append(cotangent)
        pose_gradients.append(torch.zeros(6, dtype=torch.float64) if xi.grad is None else xi.grad)
    for prefix, parts in (("picture", shots), ("cotangent", cotangents)):
        for part, views_of in zip(("colour", "alpha", "depth"), zip(*parts)):
            out[f"{prefix}.{part}"] = torch.stack(views_of)
    for f, x in zip(splat3d.GAUSSIAN_FIELDS, g.fields()):
        out[f"grad.{f}"] = torch.zeros_like(x) if x.grad is None else x.grad
    out["grad.pose"] = torch.stack(pose_gradients)
    meta = {"count": count, "degree": degree, "views": views, "width": width, "height": height}
    return {k: v.float() for k, v in out.items()}, meta


def main():
    folder, size = sys.argv[1], sys.argv[2]
    os.makedirs(folder, exist_ok=True)
    sources = max(map(os.path.getmtime, glob.glob(os.path.join(os.path.dirname(os.path.abspath(__file__)), "*.py"))))
    for name, shape in (SMALL if size == "small" else LARGE).items():
        path = os.path.join(folder, name + ".safetensors")
        if os.path.exists(path) and os.path.getmtime(path) > sources:
            continue
        tensors, meta = case(name, shape)
        safetensors_file.save_safetensors(path + ".tmp", tensors, meta)
        os.replace(path + ".tmp", path)
        stopped = (tensors["picture.alpha"] > 0.999).float().mean().item()
        norms = ", ".join(f"{k[5:]} {v.norm():.3g}" for k, v in tensors.items() if k.startswith("grad."))
        print(f"{name}: alpha over 0.999 at {100 * stopped:.0f} % of the pixels; gradients {norms}", flush=True)


if __name__ == "__main__":
    main()
