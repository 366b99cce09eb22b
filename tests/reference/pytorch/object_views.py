"""Cameras about an object, its frame, and pictures of a test object."""
import math

import numpy as np
import torch
import torch.nn.functional as F


def place(c2w, centre, edge):
    """World to object units: the object's cube (centre, edge length) becomes [-0.5,0.5]^3."""
    out = c2w.clone()
    out[:, :3, 3] = (c2w[:, :3, 3] - torch.as_tensor(centre).to(c2w)) / edge
    return out


def rebase(c2w):
    """Turn the world about the origin so that the first view has identity rotation; the object stays in its cube."""
    m = torch.eye(4).to(c2w)
    m[:3, :3] = c2w[0, :3, :3].T
    return m @ c2w


def orbit_cameras(count, cfg, radius=1.6, fov_deg=50.0, seed=0):
    """Cameras on a sphere looking at the origin; the first one is the frame of the object:
    identity rotation at (0,0,-radius), as the published loaders arrange."""
    rng = np.random.default_rng(seed)
    out = []
    for i in range(count):
        az = 2 * math.pi * i / count + (rng.uniform(-0.3, 0.3) if i else 0)
        el = rng.uniform(-0.5, 0.5) if i else 0.0
        eye = np.array([radius * math.cos(el) * math.sin(az), radius * math.sin(el), -radius * math.cos(el) * math.cos(az)])
        f = -eye / np.linalg.norm(eye)
        right = np.cross(f, [0, -1, 0]); right /= np.linalg.norm(right)
        c2w = np.eye(4)
        c2w[:3, 0], c2w[:3, 1], c2w[:3, 2], c2w[:3, 3] = right, np.cross(f, right), f, eye
        out.append(c2w)
    focal = 0.5 * cfg.image / math.tan(math.radians(fov_deg) / 2)
    K = np.array([[focal, 0, cfg.image / 2], [0, focal, cfg.image / 2], [0, 0, 1.0]])
    return torch.tensor(np.stack(out), dtype=torch.float32), torch.tensor(K, dtype=torch.float32).expand(count, 3, 3).clone()


def checked_ball(c2w, K, size):
    """A ball and a box with a checker pattern on white, ray traced: (V,H,W,3). Test input only."""
    v, u = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
    images = []
    for cam, k in zip(c2w, K):
        d = torch.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], torch.ones_like(u)], -1) @ cam[:3, :3].T
        d = F.normalize(d, dim=-1)
        o = cam[:3, 3]
        centre = torch.tensor([0.05, -0.05, 0.0])
        oc = o - centre
        bq = (d * oc).sum(-1); disc = bq * bq - ((oc * oc).sum() - 0.3 ** 2)
        t = torch.where(disc > 0, -bq - torch.sqrt(disc.clamp(min=0)), torch.full_like(bq, 1e9))
        p = o + t.clamp(max=100)[..., None] * d
        n = F.normalize(p - centre, dim=-1)
        check = ((torch.floor(p * 8).sum(-1) % 2) == 0).float()[..., None]
        base = check * torch.tensor([0.9, 0.3, 0.2]) + (1 - check) * torch.tensor([0.2, 0.4, 0.9])
        shade = 0.4 + 0.6 * (n @ F.normalize(torch.tensor([0.3, -0.8, -0.5]), dim=0)).clamp(min=0)[..., None]
        images.append(torch.where((disc > 0)[..., None], base * shade, torch.ones(3)))
    return torch.stack(images)
