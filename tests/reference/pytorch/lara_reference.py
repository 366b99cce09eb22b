"""Executable specification of LaRa (ECCV 2024), in PyTorch, written for clarity.

Four posed pictures -> a volume transformer -> two surfels in every voxel of a 64^3 grid -> drawn in
the input views -> the surfels that are not transparent get finer colours from what the pictures and
those drawings say at their places -> drawn anywhere.

Conventions are those of vsplat_reference.py: OpenCV cameras, pixel centres at +0.5, the object in
[-0.5,0.5]^3, channels last, voxel (i,j,k) with i along x and slowest, quaternions w x y z, one
object at a time. Parameter and buffer names, and their order, are those of the published
checkpoints without the leading "net.", so a state dict of this module is also a key-name test.
The same module with other sizes is the backbone of GenDen (genden_reference.py).

Needs only torch >= 1.13 and numpy, and vsplat_reference.py and splat2d_reference.py beside it.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import torch
import torch.nn.functional as F
from torch import nn
from torch.utils.checkpoint import checkpoint

import splat2d_reference as splat2d
import splat3d_reference as splat3d
import vsplat_reference as ref
from splat3d_reference import Gaussians
from vsplat_reference import OPACITY_SHIFT


@dataclass
class Config:
    """The defaults are the published sizes (125.3 M parameters)."""
    image: int = 512            # input and drawing resolution, square
    views: int = 4              # how many are given; at most `view_slots`
    patch: int = 16
    vit_dim: int = 768
    vit_depth: int = 12
    vit_heads: int = 12
    vit_pos_grid: int = 14      # side of the stored position embedding (224/16)
    feature_volume: int = 16    # side of the grid that the pictures are lifted to, every view by itself
    volume: int = 32            # side of the transformer's grid; the primitives' grid has twice that
    windows: tuple = (16,)      # cells per axis of the attention windows; layer i takes windows[i mod len]
    volume_ch: int = 256
    layers: int = 12
    heads: int = 16
    view_slots: int = 4
    view_ch: int = 32           # width of the learned embedding of a view's number
    out_ch: int = 80            # width of the upsampled volume and of the decoders
    primitives: int = 2         # K per voxel
    kind: str = "surfel"        # "surfel": 2 scales, drawn by splat2d_reference; "gaussian": 3 scales, drawn by vsplat_reference (GenDen)
    offset_cells: int = 32      # a primitive stays within 0.25/offset_cells of its voxel's centre, per axis (= half a voxel)
    fine_heads: int = 8
    fine_hidden: int = 64
    fine_features: int = 0      # GenDen: the fine decoder also gives so many features, before its colours
    sh_degree: int = 1
    opacity_threshold: float = 0.005
    sample_half_pixel: bool = True      # add half a pixel before sampling (published weights expect it)
    negate_camera_centre: bool = True   # view-dependent colour as seen from -centre (published weights were trained so)
    revision: str = "lara"      # of the surfel rasteriser: "lara" or "current"

    @property
    def tokens(self):
        return self.image // self.patch

    @property
    def sh_dim(self):
        return (self.sh_degree + 1) ** 2 * 3

    @property
    def scale_dim(self):
        return 2 if self.kind == "surfel" else 3

    @property
    def grid(self):
        return 2 * self.volume

    def check(self):
        def need(ok, text):
            if not ok:
                raise ValueError(text)
        for f in fields(self):
            if isinstance(f.default, int) and not isinstance(f.default, bool) and f.name != "fine_features":
                need(getattr(self, f.name) >= (0 if f.name == "sh_degree" else 1), f"{f.name} is too small")
        need(self.image % self.patch == 0, "image must be a multiple of patch")
        need(self.vit_dim % self.vit_heads == 0, "vit_dim must be a multiple of vit_heads")
        need(self.volume_ch % self.heads == 0, "volume_ch must be a multiple of heads")
        need(self.out_ch % self.fine_heads == 0, "out_ch must be a multiple of fine_heads")
        need(1 <= self.views <= self.view_slots, "views must be 1 to view_slots")
        need(self.sh_degree <= 3, "sh_degree must be 0 to 3")
        need(len(self.windows) > 0, "windows must not be empty")
        for n in self.windows:
            need(self.volume % n == 0 and self.feature_volume % n == 0, "both volumes must be multiples of every entry of windows")
        need(self.kind in ("surfel", "gaussian"), "kind must be surfel or gaussian")
        need(self.revision in ("lara", "current"), "revision must be lara or current")
        return self

    def with_fields(self, **changes):
        return replace(self, **changes).check()


CONFIGS = {
    "published": Config(),
    # Seconds on two CPU cores; odd enough that a transposed axis or a hard-coded size shows.
    "tiny": Config(image=24, views=3, patch=4, vit_dim=24, vit_depth=2, vit_heads=3, vit_pos_grid=4, feature_volume=3, volume=6,
                   windows=(3,), volume_ch=16, layers=3, heads=4, view_ch=4, out_ch=12, offset_cells=5, fine_heads=2, fine_hidden=10),
    # Everything is there, almost nothing of it: its vectors are committed. Windows of both kinds, several keys of a view in one.
    "micro": Config(image=12, views=2, patch=4, vit_dim=12, vit_depth=1, vit_heads=2, vit_pos_grid=2, feature_volume=2, volume=2,
                    windows=(2, 1), volume_ch=8, layers=2, heads=2, view_slots=3, view_ch=3, out_ch=6, offset_cells=3, fine_heads=2, fine_hidden=5),
}
# As GenDen has it: one Gaussian a voxel, and features beside the fine decoder's colours.
CONFIGS["tiny_gaussian"] = CONFIGS["tiny"].with_fields(kind="gaussian", primitives=1, fine_heads=3, fine_hidden=14, fine_features=5)
CONFIGS["micro_gaussian"] = CONFIGS["micro"].with_fields(kind="gaussian", primitives=1, fine_heads=3, fine_features=2)


# ------------------------------------------------------------------------------- camera modulation

class Modulation(nn.Module):
    """Adaptive layer norm as LaRa has it: SiLU on the ray embedding itself, then its only Linear."""

    def __init__(self, dim):
        super().__init__()
        self.norm = nn.LayerNorm(dim, eps=1e-6)
        self.mlp = nn.Sequential(nn.SiLU(), nn.Linear(32, 2 * dim))

    def forward(self, x, pluck):                                # (V,h,w,C), (V,h,w,6)
        cond = torch.cat([ref.real_sh3(pluck[..., :3]), ref.real_sh3(pluck[..., 3:])], -1)
        shift, scale = self.mlp(cond).chunk(2, -1)
        return self.norm(x) * (1 + scale) + shift


# ------------------------------------------------------------------------------- volume transformer

class _Out(nn.Module):
    def __init__(self, dim):
        super().__init__()
        self.weight = nn.Parameter(torch.empty(dim, dim))


class CrossAttention(nn.Module):
    """Multi-head attention without any bias; keys and values have a width of their own."""

    def __init__(self, dim, cond, heads):
        super().__init__()
        self.heads = heads
        self.q_proj_weight = nn.Parameter(torch.empty(dim, dim))
        self.k_proj_weight = nn.Parameter(torch.empty(dim, cond))
        self.v_proj_weight = nn.Parameter(torch.empty(dim, cond))
        self.out_proj = _Out(dim)
        for p in self.parameters():
            nn.init.xavier_uniform_(p)

    def forward(self, x, cond):                                 # (G,L,C), (G,S,C') -> (G,L,C)
        split = lambda t: t.reshape(*t.shape[:2], self.heads, t.shape[2] // self.heads).transpose(1, 2)
        q, k, v = split(x @ self.q_proj_weight.T), split(cond @ self.k_proj_weight.T), split(cond @ self.v_proj_weight.T)
        a = torch.softmax(q @ k.transpose(-1, -2) / math.sqrt(q.shape[-1]), -1) @ v
        return a.transpose(1, 2).reshape(x.shape) @ self.out_proj.weight.T


def to_windows(x, n):
    """(R,R,R,C) -> (n^3, (R/n)^3, C): the cells of an n^3 grid, i slowest, and the voxels inside each, i slowest."""
    r, c = x.shape[0], x.shape[-1]
    b = r // n
    return x.reshape(n, b, n, b, n, b, c).permute(0, 2, 4, 1, 3, 5, 6).reshape(n ** 3, b ** 3, c)


def from_windows(x, n, r):
    b, c = r // n, x.shape[-1]
    return x.reshape(n, n, n, b, b, b, c).permute(0, 3, 1, 4, 2, 5, 6).reshape(r, r, r, c)


class WindowLayer(nn.Module):
    """Every cell's voxels look at that cell's lifted features from all views; then an MLP; then a
    3x3x3 convolution that connects the cells. Mind the last step: x <- n + conv(n) with n = norm3(x),
    so what is carried on is the *normalised* volume."""

    def __init__(self, cfg: Config):
        super().__init__()
        c = cfg.volume_ch
        self.norm1 = nn.LayerNorm(c)                            # eps 1e-5 here, 1e-6 elsewhere
        self.cross_attn = CrossAttention(c, cfg.vit_dim + cfg.view_ch, cfg.heads)
        self.cnn = nn.Conv3d(c, c, 3, padding=1, bias=False)
        self.norm2, self.norm3 = nn.LayerNorm(c), nn.LayerNorm(c)
        self.mlp = nn.Sequential(nn.Linear(c, 2 * c), nn.GELU(), nn.Dropout(0.0), nn.Linear(2 * c, c), nn.Dropout(0.0))

    def forward(self, x, cond, n, trace=None, name=""):         # (R,R,R,C), (n^3,S,C')
        t = {} if trace is None else trace
        r = x.shape[0]
        y = to_windows(x, n)
        y = y + self.cross_attn(self.norm1(y), cond)
        t[f"{name}attention"] = from_windows(y, n, r).reshape(r ** 3, -1)
        y = y + self.mlp(self.norm2(y))
        t[f"{name}mlp"] = from_windows(y, n, r).reshape(r ** 3, -1)
        y = from_windows(self.norm3(y), n, r)
        y = y + self.cnn(y.permute(3, 0, 1, 2)[None])[0].permute(1, 2, 3, 0)
        t[f"{name}output"] = y.reshape(r ** 3, -1)
        return y


class VolumeTransformer(nn.Module):
    def __init__(self, cfg: Config):
        super().__init__()
        self.cfg = cfg
        c, r = cfg.volume_ch, cfg.volume
        self.pos_embed = nn.Parameter(torch.randn(1, c, r, r, r) / math.sqrt(c))
        self.layers = nn.ModuleList(WindowLayer(cfg) for _ in range(cfg.layers))
        self.norm = nn.LayerNorm(c, eps=1e-6)
        self.deconv = nn.ConvTranspose3d(c, cfg.out_ch, 2, stride=2)

    def forward(self, cond, trace=None):                        # (V, r^3, C') lifted features -> ((2R)^3, out_ch)
        cfg, t = self.cfg, {} if trace is None else trace
        r = cfg.feature_volume
        grids = []
        for n in cfg.windows:                                   # a cell's keys: all of view 0, then all of view 1, ...
            per_view = [to_windows(v.reshape(r, r, r, -1), n) for v in cond]
            grids.append(torch.cat(per_view, 1))
        x = self.pos_embed[0].permute(1, 2, 3, 0)               # the learned volume is where every object starts
        for i, layer in enumerate(self.layers):
            j = i % len(cfg.windows)
            x = layer(x, grids[j], cfg.windows[j], t, f"layer.{i}.")
        x = self.norm(x)
        x = self.deconv(x.permute(3, 0, 1, 2)[None])[0]
        return x.permute(1, 2, 3, 0).reshape(-1, cfg.out_ch)


# ------------------------------------------------------------------------------------------ decoder

class Decoder(nn.Module):
    """`mlp_coarse`: a voxel's feature -> K primitives. `norm`, `cross_att`, `mlp_fine`: the voxel's
    feature looks at what V pictures show at the primitive's place (8 numbers each)."""

    def __init__(self, cfg: Config):
        super().__init__()
        c = cfg.out_ch
        out = 3 + cfg.sh_dim + 1 + cfg.scale_dim + 4            # offset, SH, opacity, scale, rotation
        self.mlp_coarse = nn.Sequential(nn.Linear(c, c), nn.ReLU(), nn.Linear(c, c), nn.ReLU(), nn.Linear(c, out * cfg.primitives))
        self.norm = nn.LayerNorm(c)
        self.cross_att = CrossAttention(c, 8, cfg.fine_heads)
        self.mlp_fine = nn.Sequential(nn.Linear(c, cfg.fine_hidden), nn.ReLU(), nn.Linear(cfg.fine_hidden, cfg.fine_features + cfg.sh_dim))
        for m in (*self.mlp_coarse, *self.mlp_fine):
            if isinstance(m, nn.Linear):
                nn.init.xavier_uniform_(m.weight)
                nn.init.zeros_(m.bias)

    def fine(self, feature, samples):                           # (P,c), (P,V,8) -> (P, fine_features + sh_dim)
        x = self.cross_att(self.norm(feature)[:, None], samples)
        return self.mlp_fine(x)[:, 0]


class LaRa(nn.Module):
    def __init__(self, cfg: Config):
        super().__init__()
        self.cfg = cfg
        self.view_embed = nn.Parameter(torch.randn(1, cfg.view_slots, cfg.view_ch, 1, 1, 1) / math.sqrt(cfg.view_ch))
        grid = lambda r: ref.voxel_centres(r, torch.zeros(1)).reshape(r, r, r, 3)
        if cfg.kind == "surfel":                                # stored, never read; GenDen left them out
            self.register_buffer("dense_grid", grid(cfg.volume))
            self.register_buffer("centers", grid(cfg.grid))
        self.register_buffer("volume_grid", grid(cfg.feature_volume))
        self.register_buffer("group_centers", grid(cfg.grid).reshape(1, -1, 3))
        self.img_encoder = nn.Module()
        self.img_encoder.model = ref.ViT(cfg)
        self.dir_norm = Modulation(cfg.vit_dim)
        self.vol_decoder = VolumeTransformer(cfg)
        self.decoder = Decoder(cfg)

    @property
    def edge(self):
        """Edge of a primitive's voxel."""
        return 1.0 / self.cfg.grid

    # Each stage returns what the next one needs.

    def features(self, images, c2w, K):                         # (V,H,W,3) -> (V,h,w,C)
        x = self.img_encoder.model(images)
        return self.dir_norm(x, ref.plucker(c2w, K, self.cfg.tokens, self.cfg.patch))

    def lift(self, feats, c2w, K):
        """-> (V, r^3, C + view_ch): bilinear samples at the projected centres of the feature volume, zero
        outside, views kept apart; then the learned embedding of the view's number."""
        points = ref.voxel_centres(self.cfg.feature_volume, feats)
        s, _ = ref.sample_views(feats, points, torch.inverse(c2w), K, self.cfg)
        v = self.view_embed[0, :len(s), :, 0, 0, 0]             # (V,view_ch)
        return torch.cat([s, v[:, None].expand(-1, s.shape[1], -1)], -1)

    def coarse(self, volume):
        """((2R)^3, c) -> primitives, K per voxel, voxel by voxel."""
        cfg = self.cfg
        raw = self.decoder.mlp_coarse(volume).reshape(len(volume) * cfg.primitives, -1)
        off, sh, op, sc, rot = raw.split([3, cfg.sh_dim, 1, cfg.scale_dim, 4], -1)
        centres = ref.voxel_centres(cfg.grid, volume).repeat_interleave(cfg.primitives, 0)
        reach = 0.25 / cfg.offset_cells
        return Gaussians(centres + (2 * torch.sigmoid(off) - 1) * reach, torch.exp(sc + math.log(self.edge / 3)),
                         F.normalize(rot, dim=-1), torch.sigmoid(op[:, 0] + OPACITY_SHIFT), sh.reshape(len(raw), -1, 3))

    def draw(self, g: Gaussians, c2w, K, background):
        """-> dictionary of stacked maps: image clamped to [0,1], alpha, depth (and what LaRa's loss takes)."""
        cfg, mirror = self.cfg, torch.zeros(3) if self.cfg.negate_camera_centre else None
        bg = torch.as_tensor(background).to(c2w)
        maps = []
        for i in range(len(c2w)):
            if cfg.kind == "surfel":
                m = splat2d.render(g, c2w[i], K[i], cfg.image, cfg.image, bg, mirror, cfg.revision)
                m = splat2d.lara_maps(m, c2w[i], K[i])
                maps.append({f: getattr(m, f) for f in splat2d.LARA_MAP_FIELDS})
            else:                                               # depth stays accumulated here, not divided by alpha
                shot = lambda *f, c=c2w[i], k=K[i]: splat3d.render(Gaussians(*f), c, k, cfg.image, cfg.image, bg, mirror=mirror)
                image, alpha, depth = checkpoint(shot, *g.fields(), use_reentrant=False) if torch.is_grad_enabled() else shot(*g.fields())
                maps.append({"image": image.clamp(0, 1), "alpha": alpha, "depth": depth})
        return {k: torch.stack([m[k] for m in maps]) for k in maps[0]}

    def keep(self, opacities, uniform=None):
        """Which primitives go on, (N,) bool. The published code, when fewer than one in a thousand is opaque
        enough, adds a fifth of all at random (those with `uniform` + kept > 0.8), at inference too; without
        `uniform` nothing is added. In training it also drops half of them when more than half are kept."""
        kept = opacities.detach() > self.cfg.opacity_threshold
        if uniform is not None and kept.sum() / kept.numel() < 1e-3:
            kept = (kept.to(uniform) + uniform) > 0.8
        return kept

    def samples(self, points, images, drawings, c2w, K):
        """-> (P,V,8): photograph (3), drawing (3), alpha (1), |drawn depth - the point's depth| (1)."""
        maps = torch.cat([images, drawings["image"], drawings["alpha"][..., None], drawings["depth"][..., None]], -1)
        s, z = ref.sample_views(maps, points, torch.inverse(c2w), K, self.cfg)         # (V,P,8), (V,P)
        return torch.cat([s[..., :7], (s[..., 7] - z).abs()[..., None]], -1).transpose(0, 1)

    def stages(self, images, c2w, K, background=(1.0, 1.0, 1.0), drawings=None, uniform=None, trace=None):
        """-> coarse primitives, index (P,) of those kept, their fine decoder's output (P,...), volume feature of each.
        `drawings` replaces the coarse drawings in the input views (and cuts the gradient through them)."""
        cfg, t = self.cfg, {} if trace is None else trace
        feats = t["features"] = self.features(images, c2w, K)
        cond = t["lifted"] = self.lift(feats, c2w, K)
        volume = t["volume"] = self.vol_decoder(cond, t)
        g = self.coarse(volume)
        for f in splat3d.GAUSSIAN_FIELDS:
            t[f"coarse.{f}"] = getattr(g, f)
        d = self.draw(g, c2w, K, background) if drawings is None else drawings
        for k, v in d.items():
            t[f"drawing.{k}"] = v
        index = t["fine.index"] = self.keep(g.opacities, uniform).nonzero()[:, 0]
        feature = volume[index // cfg.primitives]
        s = t["fine.samples"] = self.samples(g.means[index], images, d, c2w, K)
        fine = t["fine.output"] = self.decoder.fine(feature, s)
        return g, index, fine, feature

    def forward(self, images, c2w, K, background=(1.0, 1.0, 1.0), drawings=None, uniform=None, trace=None):
        """images (V,H,W,3), c2w (V,4,4), K (V,3,3) of the input views -> coarse and final primitives."""
        t = {} if trace is None else trace
        g, index, fine, _ = self.stages(images, c2w, K, background, drawings, uniform, t)
        sh = g.sh[index] + fine[:, self.cfg.fine_features:].reshape(len(index), self.cfg.sh_dim // 3, 3)
        final = Gaussians(g.means[index], g.scales[index], g.quats[index], g.opacities[index], sh)
        for f in splat3d.GAUSSIAN_FIELDS:
            t[f"final.{f}"] = getattr(final, f)
        return g, final



def parameters(model):
    """[(name, shape, "parameter" or "buffer")] in the order of the checkpoint's state dict; names carry "net."."""
    learned = dict(model.named_parameters())
    return [(f"net.{k}", tuple(v.shape), "parameter" if k in learned else "buffer") for k, v in model.state_dict().items()]


def count(model):
    return sum(p.numel() for p in model.parameters())
