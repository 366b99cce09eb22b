"""Write the scenes of surfels that drawing and its derivative are held against, one file each: what `render` of
splat2d_reference.py makes of them in float64, and what autograd then says.

    python3 make_surfels.py DIR surfels_small        the committed ones
    python3 make_surfels.py DIR surfels              those that are made when they are needed

Tensors as in make_splat.py, with scales [K,2]; beside colour, alpha and depth there are
    picture.{normal,median,distortion}               [V,H,W,3] [V,H,W] [V,H,W]
    cotangent.{normal,distortion}                    the median has no gradient
Metadata beside those there: revision.

No scene has a value near a place where a map jumps or its derivative does: see `offenders`. Surfels that come near one
are drawn again until none does.
"""
import glob
import os
import sys

import numpy as np
import torch

import safetensors_file
import splat2d_reference as splat2d
import splat3d_reference as splat3d
from make_splat import cameras, hat, single, widen

# surfels, SH degree, width, height, cameras, revision, what is special
SMALL = {
    "surfels_seventeen": (17, 1, 19, 17, 1, "lara", "behind"),
    "surfels_prime": (29, 1, 23, 13, 1, "current", "off-centre"),
}
LARGE = {
    "surfels_plain": (150, 1, 61, 43, 1, "lara", "behind"),
    "surfels_current": (100, 2, 48, 37, 2, "current", "behind"),
    "surfels_lengths": (60, 2, 47, 33, 1, "lara", "off-centre lengths"),
    "surfels_around": (150, 1, 40, 40, 1, "lara", "near"),
    "surfels_around_current": (150, 1, 40, 40, 1, "current", "near"),
    "surfels_edge": (40, 0, 31, 17, 1, "lara", "edge"),
    "surfels_low_pass": (200, 1, 33, 31, 1, "lara", "low-pass"),
    "surfels_low_pass_current": (200, 1, 33, 31, 1, "current", "low-pass"),
    "surfels_mirror": (60, 3, 16, 47, 1, "lara", "mirror"),
    "surfels_large": (12, 1, 90, 20, 1, "current", "large"),
    "surfels_stops": (150, 0, 24, 20, 1, "lara", "stops"),
    "surfels_empty": (0, 1, 19, 7, 1, "lara", ""),
}


def draw(rng, count, degree, kind, w2c):
    """Columns of `count` random surfels, float32 values."""
    scale = {"large": 0.4, "low-pass": 0.004, "stops": 0.12, "near": 0.1}.get(kind, 0.05)
    reach = 2 if kind == "near" else 0.4 if kind == "stops" else 0.5
    means = rng.uniform(-reach, reach, (count, 3))
    if kind == "behind" and count > 2:  # the camera's place and beyond; nearer than the near plane
        eye = np.linalg.inv(w2c[0].numpy())[:3, 3]
        means[0], means[1] = 1.2 * eye, 0.9 * eye
    scales = scale * np.exp(rng.normal(0, 0.6, (count, 2)))
    opacities = rng.uniform(0.4 if kind == "stops" else 0.1, 0.5 if kind == "large" else 0.95, count)
    quats = rng.normal(size=(count, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    if kind == "edge":  # nearly edge on: at half of this, half a rounding of a mean moves gradients by 1e-4 of the largest
        turns = rng.normal(size=(count, 200, 4))
        turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
        sight = means - np.linalg.inv(w2c[0].numpy())[:3, 3]
        sight /= np.linalg.norm(sight, axis=1, keepdims=True)
        for k in range(count):
            facing = (splat3d.rotation(torch.tensor(turns[k]))[:, :, 2].numpy() @ sight[k])
            quats[k] = turns[k][np.argmin(np.abs(np.abs(facing) - 0.1))]
    if "lengths" in kind:
        quats *= rng.uniform(0.3, 3, (count, 1))
    sh = rng.normal(0, 0.5, (count, (degree + 1) ** 2, 3))
    return [single(x) for x in (means, scales, quats, opacities, sh)]


def offenders(g, w2c, K, width, height, mirror, revision):
    """Which surfels (K,) come so near a jump or a kink that float32 may well fall on its other side: alpha within 1e-4 of 1/255 or
    0.99, transmittance within 1e-3 of 1e-4 or within 1e-4 of 1/2, the centre's z within 1e-4 of the near plane or within 2e-6 of
    another's, an intersection's z within 1e-4 of the near plane, the low pass within 1e-4 of deciding, a normal within 1e-2 of
    edge on (whose plane float32 knows to 1e-5 then), an intersection over twice as far away as its centre (towards the plane's horizon, one pixel would be all of the
    gradient), the square within 1e-3 pixels of gaining a pixel or a tile, a colour within 1e-4 of its limit 0. The pictures' own
    functions tell none of these, so they are computed once more."""
    bad = torch.zeros(len(g.means), dtype=torch.bool)
    if len(bad) == 0:
        return bad
    c2w = torch.inverse(w2c)
    R, p = w2c[:3, :3] @ splat3d.rotation(g.quats), g.means @ w2c[:3, :3].T + w2c[:3, 3]
    near = splat2d.NEAR
    bad |= (p[:, 2] - near).abs() < 1e-4
    bad |= (R[:, :, 2] * p).sum(-1).abs() / p.norm(dim=-1) < 1e-2
    # As `project` has it, before anything is cut off or rounded.
    M = torch.stack([R[:, :, 0] * g.scales[:, :1], R[:, :, 1] * g.scales[:, 1:2], p], -1)
    T = K @ M
    cut = splat2d.BOX_SIGMAS[revision]
    sign = torch.tensor([cut * cut, cut * cut, -1.0]).double()
    d = (sign * T[:, 2] ** 2).sum(-1)
    bad |= (d / p[:, 2] ** 2).abs() < 1e-3
    f = sign / d[:, None]
    centre = torch.stack([(f * T[:, i] * T[:, 2]).sum(-1) for i in (0, 1)], -1)
    half = torch.stack([centre[:, i] ** 2 - (f * T[:, i] ** 2).sum(-1) for i in (0, 1)], -1).amax(-1).clamp(min=0).sqrt()
    low = splat2d.LOW_PASS_SIGMA[revision]
    size = 3 * half.clamp(min=low) if revision == "lara" else half.clamp(min=3 * low)
    bad |= ((size - size.round()).abs() < 1e-5 * size.clamp(min=1)) & (half > low)
    at = centre if revision == "lara" else centre - 0.5
    tiles = torch.tensor([(width + 15) // 16, (height + 15) // 16])
    for edge in ((at - size.ceil()[:, None]) / 16, (at + size.ceil()[:, None] + 15) / 16):
        close = ((edge - edge.round()).abs() < 1e-3 / 16) & (edge.round() > 0) & (edge.round() <= tiles)
        bad |= close.any(1)
    colour = splat2d.colours(g, c2w, mirror)
    unclamped = (splat3d.sh_basis(torch.nn.functional.normalize(
        g.means - (c2w[:3, 3] if mirror is None else 2 * mirror - c2w[:3, 3]), dim=-1), g.sh.shape[1])[..., None] * g.sh).sum(1) + 0.5
    assert torch.equal(unclamped.clamp(min=0), colour)
    bad |= (unclamped.abs() < 1e-4).any(1)

    s = splat2d.project(g, c2w, K, width, height, revision)
    gap = (s.z[1:] - s.z[:-1]) / s.z[1:]
    bad[s.index[1:][gap < 2e-6]] = True
    opacity = g.opacities[s.index]
    Tu, Tv, Tw = s.T.unbind(1)
    for row in range(height):
        px, py = torch.arange(width).double() + 0.5, row + 0.5
        k, l = px[:, None, None] * Tw - Tu, py * Tw - Tv
        h = torch.cross(k, l.expand_as(k), dim=-1)
        u, v = h[..., 0] / h[..., 2], h[..., 1] / h[..., 2]
        rho3, rho2 = u * u + v * v, 2 * ((s.centre[:, 0] - px[:, None]) ** 2 + (s.centre[:, 1] - py) ** 2)
        on = rho3 <= rho2
        z = u * Tw[:, 0] + v * Tw[:, 1] + Tw[:, 2]
        z = torch.where(on, z, Tw[:, 2].expand_as(z)) if revision == "lara" else z
        alpha = opacity * torch.exp(-0.5 * torch.minimum(rho3, rho2))
        tx, ty = torch.arange(width)[:, None] // 16, row // 16
        inside = (s.rect[:, 0] <= tx) & (tx < s.rect[:, 1]) & (s.rect[:, 2] <= ty) & (ty < s.rect[:, 3])
        drawn = inside & (z >= near) & (alpha >= splat3d.MIN_ALPHA)
        close = inside & (((alpha / splat3d.MIN_ALPHA - 1).abs() < 1e-4) | ((alpha / splat3d.MAX_ALPHA - 1).abs() < 1e-4))
        close |= inside & (alpha > 0.9 * splat3d.MIN_ALPHA) & (((z - near).abs() < 1e-4) | ((rho3 / rho2 - 1).abs() < 1e-4))
        close |= drawn & (z > 2 * s.z)
        alpha = torch.where(drawn, alpha, torch.zeros_like(alpha)).clamp(max=splat3d.MAX_ALPHA)
        after = torch.cumprod(1 - alpha, 1)
        before = torch.cat([torch.ones_like(after[:, :1]), after[:, :-1]], 1)
        close |= (((after / splat3d.MIN_TRANSMITTANCE - 1).abs() < 1e-3) | ((before - 0.5).abs() < 1e-4)) & (alpha > 0)
        bad[s.index[(close & (before >= splat3d.MIN_TRANSMITTANCE * 0.99)).any(0)]] = True
    return bad


def lens_matrix(lens):
    fx, fy, cx, cy = lens
    return torch.tensor([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=torch.float64)


def settled_scene(name, shape):
    """Gaussians, w2c, intrinsics, mirror."""
    count, degree, width, height, views, revision, kind = shape
    rng = np.random.default_rng([*name.encode()])
    w2c, lens = cameras(rng, views, width, height, kind)
    mirror = widen([0.1, -0.2, 0.3]) if kind == "mirror" else None
    columns = draw(rng, count, degree, kind, w2c)
    for _ in range(1000):
        g = splat3d.Gaussians(*[torch.tensor(c) for c in columns])
        bad = torch.zeros(count, dtype=torch.bool)
        for v in range(views):
            bad |= offenders(g, w2c[v], lens_matrix(lens[v]), width, height, mirror, revision)
        if not bad.any():
            return g, w2c, lens, mirror
        again = draw(rng, int(bad.sum()), degree, kind, w2c)
        for c, fresh in zip(columns, again):
            c[bad.numpy()] = fresh
    raise SystemExit(f"{name}: no scene clear of the thresholds found in 1000 attempts")


def case(name, shape):
    count, degree, width, height, views, revision, kind = shape
    g, w2c, lens, mirror = settled_scene(name, shape)
    torch.manual_seed(sum(name.encode()))
    background = widen([1.0, 0.5, 0.25])
    for field in g.fields():
        field.requires_grad_(True)
    out = {f"input.{f}": x.detach() for f, x in zip(splat3d.GAUSSIAN_FIELDS, g.fields())}
    out.update({"input.w2c": w2c, "input.intrinsics": lens, "input.background": background, "input.near": torch.tensor([splat2d.NEAR])})
    if mirror is not None:
        out["input.mirror"] = mirror
    shots, cotangents, pose_gradients = [], [], []
    names = {"image": "colour", "alpha": "alpha", "depth": "depth", "normal": "normal", "median": "median", "distortion": "distortion"}
    for v in range(views):
        xi = torch.zeros(6, dtype=torch.float64, requires_grad=True)
        c2w = torch.inverse(torch.matrix_exp(hat(xi)) @ w2c[v])
        m = splat2d.render(g, c2w, lens_matrix(lens[v]), width, height, background, mirror, revision)
        shot = {names[f]: getattr(m, f) for f in splat2d.MAP_FIELDS}
        cotangent = {f: widen(torch.randn_like(x.detach())) for f, x in shot.items() if f != "median"}
        loss = sum((c * shot[f]).sum() for f, c in cotangent.items())
        if loss.requires_grad:
            loss.backward()
        shots.append({f: x.detach() for f, x in shot.items()})
        cotangents.append(cotangent)
        pose_gradients.append(torch.zeros(6, dtype=torch.float64) if xi.grad is None else xi.grad)
    for prefix, parts in (("picture", shots), ("cotangent", cotangents)):
        for f in parts[0]:
            out[f"{prefix}.{f}"] = torch.stack([part[f] for part in parts])
    for f, x in zip(splat3d.GAUSSIAN_FIELDS, g.fields()):
        out[f"grad.{f}"] = torch.zeros_like(x) if x.grad is None else x.grad
    out["grad.pose"] = torch.stack(pose_gradients)
    meta = {"count": count, "degree": degree, "views": views, "width": width, "height": height, "revision": revision}
    return {k: v.float() for k, v in out.items()}, meta


def main():
    folder, size = sys.argv[1], sys.argv[2]
    os.makedirs(folder, exist_ok=True)
    sources = max(map(os.path.getmtime, glob.glob(os.path.join(os.path.dirname(os.path.abspath(__file__)), "*.py"))))
    for name, shape in (SMALL if size == "surfels_small" else LARGE).items():
        path = os.path.join(folder, name + ".safetensors")
        if os.path.exists(path) and os.path.getmtime(path) > sources:
            continue
        tensors, meta = case(name, shape)
        safetensors_file.save_safetensors(path + ".tmp", tensors, meta)
        os.replace(path + ".tmp", path)
        norms = ", ".join(f"{k[5:]} {v.norm():.3g}" for k, v in tensors.items() if k.startswith("grad."))
        print(f"{name}: mean alpha {tensors['picture.alpha'].mean():.2f}; gradients {norms}", flush=True)


if __name__ == "__main__":
    main()
