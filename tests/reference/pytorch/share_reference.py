"""Executable specification of VS-Splat's extension for noisy camera poses: Plücker maps predicted from the 2D features.

The predictor is that of SHARE ("Pose-Free 3D Gaussian Splatting via Shape-Ray Estimation", arXiv 2505.22978, official
repository youngju-na/SHARE), behind the input module that the VS-Splat paper gives it. Written from the facts of that
repository and of the paper; the published VS-Splat code has no extension.

What the predicted maps replace: the Plücker maps of the given cameras in the modulation (`dir_norm`), nothing else.
What goes on using the given cameras, noise and all: the object's frame (`place`, `rebase`), lifting, the projection of the
skeletal centres (PAP) and its 1/z weights, every rendering. What needs accurate cameras, in training only: the target maps
of the ray loss, and the views the rendering loss compares.

    features (N,h,w,C) of the encoder, before modulation
      -> three times GroupNorm, SiLU, 1x1 convolution: C -> share_dim       the paper's input module
      -> + sine position within a window
      -> matching transformer, windows alternately plain and shifted:       stage 1, SHARE (from UniMatch by way of MVSplat)
         self-attention within a view, cross-attention to all other views
      -> 1x1 convolution, a learned code of the view's number appended      SHARE
      -> Linear, + sine of the view's number, + sine of the token's number
      -> transformer over the tokens of all views                           stage 2, SHARE (from "Cameras as Rays")
      -> LayerNorm, Linear: (N,h,w,6), direction then moment; used as it is: the direction is not normalised

Where paper and code leave a choice, ShareConfig names it. Views are not interchangeable: view 0 is the object's frame.
"""
from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import torch
import torch.nn.functional as F
from torch import nn

import loss_reference
import vsplat_config
import vsplat_reference as ref


@dataclass
class ShareConfig(vsplat_config.Config):
    """`vsplat_config.Config` with the predictor's fields; the comments say who fixes a value: [P] the VS-Splat paper, [S] SHARE's
    code or configuration, [G] nobody, so a guess."""
    poses: str = "predicted"            # a file without this field holds "given": it has no predictor
    share_dim: int = 128                # [P] [S] width of the matching transformer
    share_reduce: tuple = (512, 256)    # [G] widths between the three 1x1 convolutions; `groups` of the norms: [G], as everywhere in the model
    share_splits: int = 2               # [S] windows along each side of the token grid
    share_match_layers: int = 6         # [S]
    share_match_mlp: int = 4            # [S] hidden width is this x 2 share_dim
    share_cross_mask: str = "tiled"     # [S] "tiled": as the code, whose mask misses its keys beyond 2 views; "aligned": as meant
    share_pre_conv: bool = True         # [S] the 1x1 convolution between the stages; the paper does not mention it
    share_max_views: int = 4            # [S] rows of the view code, so the most views: the number trained with
    share_view_dim: int = 8             # [S] width of the view code; 0: none
    share_ray_dim: int = 256            # [S]
    share_ray_layers: int = 8           # [S] 8 for DTU (objects), 4 for RealEstate10K; which one VS-Splat took: [G]
    share_ray_heads: int = 8            # [S]
    share_ray_mlp: float = 4.0          # [S] 4 for DTU, 2 for RealEstate10K; [G]
    share_detach: bool = False          # [S] true: no gradient from the predictor to the encoder
    share_loss_weight: float = 1.0      # [P] [S]

    def check(self):
        super().check()
        def need(ok, text):
            if not ok:
                raise ValueError(text)
        need(self.poses == "predicted", "poses must be predicted")
        need(len(self.share_reduce) == 2, "share_reduce must be two widths")
        for name, ch in (("vit_dim", self.vit_dim), ("share_reduce", self.share_reduce[0]), ("share_reduce", self.share_reduce[1])):
            need(ch >= 1 and ch % self.groups == 0, f"{name} must be a multiple of groups")
        need(self.share_dim >= 4 and self.share_dim % 4 == 0, "share_dim must be a multiple of 4: sine and cosine of y and x")
        need(self.share_splits >= 1 and self.tokens % self.share_splits == 0, "image / patch must be a multiple of share_splits")
        need(self.share_ray_dim % 2 == 0 and self.share_ray_dim % self.share_ray_heads == 0, "share_ray_dim must be even and a multiple of share_ray_heads")
        need(self.share_match_layers >= 1 and self.share_ray_layers >= 1, "share_match_layers and share_ray_layers must be at least 1")
        need(self.share_match_mlp >= 1 and self.share_ray_mlp > 0, "share_match_mlp and share_ray_mlp must be positive")
        need(self.share_max_views >= 2 and self.views <= self.share_max_views, "share_max_views must be at least 2 and views")
        need(self.share_view_dim >= 0, "share_view_dim must not be negative")
        need(self.share_loss_weight >= 0, "share_loss_weight must not be negative")
        need(self.share_cross_mask in ("tiled", "aligned"), "share_cross_mask must be one of tiled, aligned")
        return self

def extend(base: vsplat_config.Config, **fields) -> ShareConfig:
    return ShareConfig(**{**asdict(base), **fields}).check()


CONFIGS = {
    "paper": extend(vsplat_config.CONFIGS["paper"], fine_count=8),        # [P] M = 8 with the extension
    "small": extend(vsplat_config.CONFIGS["small"], share_dim=64, share_reduce=(192, 96), share_ray_dim=128, share_ray_layers=4, share_ray_heads=4, share_ray_mlp=2.0),
    "tiny": extend(vsplat_config.CONFIGS["tiny"], share_dim=16, share_reduce=(32, 24), share_match_layers=3, share_match_mlp=2, share_view_dim=5,
                   share_ray_dim=18, share_ray_layers=2, share_ray_heads=3, share_ray_mlp=1.5),
    # 4 x 4 tokens: the least that has shifted windows of more than one token
    "micro": extend(vsplat_config.CONFIGS["micro"], image=32, share_dim=8, share_reduce=(8, 6), share_match_layers=2, share_match_mlp=1, share_view_dim=2,
                    share_ray_dim=8, share_ray_layers=1, share_ray_heads=2, share_ray_mlp=1.0),
}


# --------------------------------------------------------------------------------- positions

def window_position(h, w, ch):
    """(h,w,ch) float64, for one window of h x w tokens. The first half of the channels holds the row, the second the column:
    rows count from 1, p = 2 pi row / (h + 1e-6); channel c of a half of n = ch/2 is sin (c even) or cos (c odd) of
    p / 10000^(2 floor(c/2) / n)."""
    n = ch // 2
    scale = 10000.0 ** (2 * (torch.arange(n, dtype=torch.float64) // 2) / n)
    def axis(count):
        p = 2 * math.pi * torch.arange(1, count + 1, dtype=torch.float64)[:, None] / (count + 1e-6) / scale
        return torch.where(torch.arange(n) % 2 == 0, torch.sin(p), torch.cos(p))                # (count,n)
    return torch.cat([axis(h)[:, None].expand(h, w, n), axis(w)[None].expand(h, w, n)], -1)


def sine_table(count, ch, base):
    """(count,ch) float64: entry (p,c) is sin (c even) or cos (c odd) of p / base^(2 floor(c/2) / ch), p from 0."""
    c = torch.arange(ch, dtype=torch.float64)
    a = torch.arange(count, dtype=torch.float64)[:, None] / base ** (2 * (c // 2) / ch)
    return torch.where(c % 2 == 0, torch.sin(a), torch.cos(a))


VIEW_BASE, TOKEN_BASE = 10000.0, 70007.0        # of the second stage's two tables


# ------------------------------------------------------------------------------------ windows

def windows(h, w, splits, shifted):
    """splits x splits windows of the h x w grid -> the tokens of each, (splits^2, L), and each token's region, same shape.

    A shifted grid is rolled up and left by half a window (rounded down) first, so that its last windows hold tokens from
    opposite borders. Tokens of different regions are strangers: the parts of the rolled grid that such a border separates."""
    wh, ww = h // splits, w // splits
    sh, sw = (wh // 2, ww // 2) if shifted and splits > 1 else (0, 0)
    row, col = torch.meshgrid(torch.arange(h), torch.arange(w), indexing="ij")                  # of the rolled grid
    token = (row + sh) % h * w + (col + sw) % w
    part = lambda i, size, win, shift: (i >= size - win).long() + (i >= size - shift).long() if shift else torch.zeros_like(i)
    region = 3 * part(row, h, wh, sh) + part(col, w, ww, sw)
    cut = lambda t: t.reshape(splits, wh, splits, ww).permute(0, 2, 1, 3).reshape(splits * splits, wh * ww)
    return cut(token), cut(region)


def window_attention(q, k, v, token, region, tiled):
    """q (N,T,C), k and v (N,M,T,C): each token attends to the tokens of its own window in the M maps of its row, in one
    softmax, one head. Strangers get -100 added to their score (not minus infinity).

    Within a window the keys are ordered token by token, the M maps of a token together. `tiled`: the code repeats the
    L x L mask M times side by side, as if the keys were ordered map by map; key j is then masked as token j mod L,
    though it is token floor(j / M). The two agree for M = 1."""
    n, m, t, c = k.shape
    win, length = token.shape
    gather = lambda x: x[:, :, token].permute(0, 2, 3, 1, 4).reshape(n, win, -1, c)             # (N,windows,L M,C)
    scores = gather(q[:, None]) @ gather(k).transpose(-1, -2) / math.sqrt(c)                    # (N,windows,L,L M)
    j = torch.arange(length * m)
    stranger = region[:, :, None] != region[:, j % length if tiled else j // m][:, None]        # (windows,L,L M)
    out = torch.softmax(scores - 100.0 * stranger.to(scores), -1) @ gather(v)
    back = torch.empty_like(token.reshape(-1))
    back[token.reshape(-1)] = torch.arange(t)
    return out.reshape(n, t, c)[:, back]


# ----------------------------------------------------------------------------------- predictor

class MatchLayer(nn.Module):
    """Attention, `merge`, norm; with an MLP also: of [source, message], 2C -> x C -> C, without biases, norm. Plus the source."""

    def __init__(self, dim, mlp):
        super().__init__()
        for name in ("q_proj", "k_proj", "v_proj", "merge"):
            setattr(self, name, nn.Linear(dim, dim, bias=False))
        self.norm1 = nn.LayerNorm(dim)                          # epsilon 1e-5
        if mlp:
            self.mlp = nn.Sequential(nn.Linear(2 * dim, 2 * dim * mlp, bias=False), nn.GELU(), nn.Linear(2 * dim * mlp, dim, bias=False))
            self.norm2 = nn.LayerNorm(dim)

    def forward(self, source, target, token, region, tiled):    # (N,T,C), (N,M,T,C)
        message = window_attention(self.q_proj(source), self.k_proj(target), self.v_proj(target), token, region, tiled)
        message = self.norm1(self.merge(message))
        if hasattr(self, "mlp"):
            message = self.norm2(self.mlp(torch.cat([source, message], -1)))
        return source + message


class MatchBlock(nn.Module):
    def __init__(self, dim, mlp):
        super().__init__()
        self.self_attn, self.cross_attn_ffn = MatchLayer(dim, 0), MatchLayer(dim, mlp)


class RayBlock(nn.Module):
    def __init__(self, dim, heads, mlp):
        super().__init__()
        self.norm1, self.attn = nn.LayerNorm(dim, eps=1e-6), ref.Attention(dim, heads)   # full, over the tokens of all views
        self.norm2, self.mlp = nn.LayerNorm(dim, eps=1e-6), nn.Module()
        self.mlp.fc1, self.mlp.fc2 = nn.Linear(dim, int(dim * mlp)), nn.Linear(int(dim * mlp), dim)

    def forward(self, x):
        x = x + self.attn(self.norm1(x))
        return x + self.mlp.fc2(F.gelu(self.mlp.fc1(self.norm2(x)), approximate="tanh"))        # not erf


class PluckerPredictor(nn.Module):
    """Weights as a training from scratch starts them (SHARE loads UniMatch's weights into `transformer` first):
    matching Linears Xavier-uniform; second stage's Linears, `x_embedder` and the head too, with zero biases; `view_pos_emb`
    normal with deviation 1; `reduce` and `pre_conv` uniform in +-1/sqrt(fan_in); norms 1 and 0."""

    def __init__(self, cfg: ShareConfig):
        super().__init__()
        self.cfg = cfg
        widths, layers = (cfg.vit_dim, *cfg.share_reduce, cfg.share_dim), []
        for cin, cout in zip(widths, widths[1:]):
            layers += [nn.GroupNorm(cfg.groups, cin, 1e-6), nn.SiLU(), nn.Conv2d(cin, cout, 1)]
        self.reduce = nn.Sequential(*layers)
        self.transformer = nn.Module()
        self.transformer.layers = nn.ModuleList(MatchBlock(cfg.share_dim, cfg.share_match_mlp) for _ in range(cfg.share_match_layers))
        if cfg.share_pre_conv:
            self.pre_conv = nn.Conv2d(cfg.share_dim, cfg.share_dim, 1)
        if cfg.share_view_dim:
            self.view_pos_emb = nn.Parameter(torch.randn(cfg.share_max_views, cfg.share_view_dim))
        rays = self.ray_predictor = nn.Module()
        rays.x_embedder = nn.Module()
        rays.x_embedder.proj = nn.Conv2d(cfg.share_dim + cfg.share_view_dim, cfg.share_ray_dim, 1)
        rays.blocks = nn.ModuleList(RayBlock(cfg.share_ray_dim, cfg.share_ray_heads, cfg.share_ray_mlp) for _ in range(cfg.share_ray_layers))
        rays.final_layer = nn.Module()
        rays.final_layer.norm_final, rays.final_layer.linear = nn.LayerNorm(cfg.share_ray_dim, eps=1e-6), nn.Linear(cfg.share_ray_dim, 6)
        for p in self.transformer.parameters():
            if p.dim() > 1:
                nn.init.xavier_uniform_(p)
        for m in self.ray_predictor.modules():
            if isinstance(m, (nn.Linear, nn.Conv2d)):
                nn.init.xavier_uniform_(m.weight)
                nn.init.zeros_(m.bias)

    def forward(self, feats, trace=None):                       # (N,h,w,C) -> (N,h,w,6)
        cfg, t = self.cfg, {} if trace is None else trace
        n, h, w, _ = feats.shape
        if not 2 <= n <= cfg.share_max_views:
            raise ValueError(f"the pose predictor takes 2 to {cfg.share_max_views} views, not {n}")
        if h % cfg.share_splits or w % cfg.share_splits:
            raise ValueError(f"a grid of {h} x {w} tokens has no {cfg.share_splits} x {cfg.share_splits} windows")
        x = feats.permute(0, 3, 1, 2)
        for i in range(0, 9, 3):                                # norm, SiLU, convolution; statistics per view
            x = self.reduce[i + 2](self.reduce[i + 1](self.reduce[i](x)))
            t[f"share.reduce{i // 3}"] = x.permute(0, 2, 3, 1)
        s = cfg.share_splits
        x = x.permute(0, 2, 3, 1) + window_position(h // s, w // s, cfg.share_dim).to(x).repeat(s, s, 1)
        t["share.positioned"] = x
        x = x.reshape(n, h * w, -1)
        for i, block in enumerate(self.transformer.layers):
            token, region = windows(h, w, s, shifted=i % 2 == 1)
            # the other views, ascending, as they were before this block's self-attention
            others = torch.stack([torch.cat([x[:v], x[v + 1:]]) for v in range(n)])             # (N,N-1,T,C)
            x = block.self_attn(x, x[:, None], token, region, tiled=False)
            t[f"share.match{i}.self"] = x.reshape(n, h, w, -1)
            x = block.cross_attn_ffn(x, others, token, region, tiled=cfg.share_cross_mask == "tiled")
            t[f"share.match{i}"] = x.reshape(n, h, w, -1)
        if cfg.share_pre_conv:
            x = x @ self.pre_conv.weight[:, :, 0, 0].T + self.pre_conv.bias
            t["share.pre_conv"] = x.reshape(n, h, w, -1)
        if cfg.share_view_dim:
            x = torch.cat([x, self.view_pos_emb[:n, None].expand(n, h * w, -1)], -1)
        rays = self.ray_predictor
        x = x @ rays.x_embedder.proj.weight[:, :, 0, 0].T + rays.x_embedder.proj.bias
        x = x + sine_table(n, cfg.share_ray_dim, VIEW_BASE).to(x)[:, None] + sine_table(h * w, cfg.share_ray_dim, TOKEN_BASE).to(x)
        t["share.embedded"] = x.reshape(n, h, w, -1)
        x = x.reshape(1, n * h * w, -1)                         # all views in one sequence, view by view, row by row
        for i, block in enumerate(rays.blocks):
            x = block(x)
            t[f"share.ray{i}"] = x.reshape(n, h, w, -1)
        x = rays.final_layer.linear(rays.final_layer.norm_final(x)).reshape(n, h, w, 6)
        t["share.plucker"] = x
        return x


class VSplatShare(ref.VSplat):
    def __init__(self, cfg: ShareConfig):
        super().__init__(cfg)
        self.share = PluckerPredictor(cfg)
        self.plucker = self._trace = None

    def features(self, images, c2w, K):
        """The given cameras are not looked at."""
        x = self.encoder.model(images)
        if self._trace is not None:
            self._trace["encoder"] = x
        self.plucker = self.share(x.detach() if self.cfg.share_detach else x, self._trace)
        return self.dir_norm(x, self.plucker)

    def forward(self, images, c2w, K, temperature=0.1, noise=None, selection=None, trace=None):
        """As ref.VSplat's, with the cameras as they are given (`noisy_cameras`). `self.plucker` holds the predicted maps."""
        self._trace = trace
        return super().forward(images, c2w, K, temperature, noise, selection, trace)


# -------------------------------------------------------------------------------------- losses

def ray_loss(predicted, true):
    """Mean over views, tokens and the six numbers, all of one weight; `true` is ref.plucker of the accurate cameras of the
    input views, in the object's frame."""
    return ((predicted - true) ** 2).mean()


def loss(coarse, final, target, predicted, true, cfg: ShareConfig):
    """The base loss plus the ray loss (the paper's two-level rendering loss is untouched)."""
    return loss_reference.loss(coarse, final, target) + cfg.share_loss_weight * ray_loss(predicted, true)


# ---------------------------------------------------------------------------------- pose noise

def se3_exp(xi):
    """(...,6), rotation w then u -> (...,4,4), the exponential of [[w] u; 0 0]: with a = |w|, R = 1 + A [w] + B [w]^2 and
    t = (1 + B [w] + C [w]^2) u, where A = sin a / a, B = (1 - cos a)/a^2, C = (a - sin a)/a^3."""
    x, y, z = xi[..., :3].unbind(-1)
    o = torch.zeros_like(x)
    k = torch.stack([o, -z, y, z, o, -x, -y, x, o], -1).reshape(*xi.shape[:-1], 3, 3)
    a = xi[..., :3].norm(dim=-1)[..., None, None]
    A, B = torch.sinc(a / math.pi), 0.5 * torch.sinc(a / 2 / math.pi) ** 2
    small = a < 0.1
    s = torch.where(small, torch.ones_like(a), a)
    C = torch.where(small, 1 / 6 - a ** 2 / 120 + a ** 4 / 5040 - a ** 6 / 362880, (s - torch.sin(s)) / s ** 3)
    eye = torch.eye(3).to(xi).expand_as(k)
    top = torch.cat([eye + A * k + B * k @ k, (eye + B * k + C * k @ k) @ xi[..., 3:, None]], -1)
    return torch.cat([top, torch.tensor([0, 0, 0, 1]).to(xi).expand(*xi.shape[:-1], 1, 4)], -2)


def noisy_cameras(c2w, xi):
    """(V,4,4), (V,6) -> (V,4,4), in the object's frame (the cube's edge is 1, its centre the origin): w2c' = w2c exp(xi), so the
    camera is turned about the object's centre and moved with it, as BARF and SPARF do."""
    return se3_exp(-xi) @ c2w


def draw_pose_noise(count, sigma, generator):
    """(count,6) float64, normal with deviation sigma in radians and in edges of the cube. View 0 defines the frame that the
    result is compared in, so it stays exact."""
    xi = torch.randn(count, 6, dtype=torch.float64, generator=generator) * sigma
    xi[0] = 0
    return xi
