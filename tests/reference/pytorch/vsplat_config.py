"""The configuration of VS-Splat: its sizes, its choices, and the named ones."""
from __future__ import annotations

from dataclasses import asdict, dataclass, replace


@dataclass
class Config:
    """One model: its sizes, and the choices in which the paper, the published code and the
    paper's ablations differ. The defaults are the paper's sizes (about 128 M parameters) with
    the published code's choices. Stored as JSON in every model file."""
    image: int = 512            # input and render resolution, square
    views: int = 4              # N, how many views are picked by default; the network takes 1 to 16
    patch: int = 16
    vit_dim: int = 768
    vit_depth: int = 12
    vit_heads: int = 12
    vit_pos_grid: int = 14      # side of the stored position embedding (224/16)
    volume: int = 48            # R = H = W = D
    volume_ch: int = 128        # C~, also the width of the U-Net
    volume_mult: tuple = (1, 2)
    voxel_ch: int = 256         # width of the refinement's sparse blocks
    voxel_levels: int = 2       # each with two residual blocks (paper: 1)
    fine_dim: int = 512
    fine_count: int = 16        # M
    sh_degree: int = 1
    groups: int = 32            # of every GroupNorm
    levels: str = "fine"        # "fine"; "skeletal": ablation (b); "coarse": ablation (a)
    selection: str = "gumbel"   # "gumbel", "sigmoid", "ste", "opacity": table A.I (d), (c), (b), (a)
    opacity_threshold: float = 0.005    # of selection "opacity"
    use_projected: bool = True  # False: ablation (c), refinement without the projected features
    view_weight: str = "depth"  # weights of the projected views: 1/"depth" (published code) or 1/"distance" (paper)
    refine_out_kernel: int = 1  # last refinement layer: 1 (published code) or 3 (paper)
    sample_half_pixel: bool = True      # add half a pixel before sampling (published weights expect it)
    negate_camera_centre: bool = False  # view-dependent colour as seen from -centre, in the object's frame (published weights were trained so)
    rebase: str = "rotate"      # "rotate": about the object's centre; "move": the first view is put on the axis (published code)

    @property
    def sh_dim(self):
        return (self.sh_degree + 1) ** 2 * 3

    @property
    def tokens(self):
        return self.image // self.patch

    def check(self):
        """Refuse by name what cannot be built."""
        def need(ok, text):
            if not ok:
                raise ValueError(text)
        for name in ("image", "patch", "vit_dim", "vit_depth", "vit_heads", "vit_pos_grid", "volume", "volume_ch", "voxel_ch", "voxel_levels", "fine_dim", "groups"):
            need(getattr(self, name) >= 1, f"{name} must be at least 1")
        need(self.image >= 11, "image must be at least 11, SSIM's window")
        need(len(self.volume_mult) >= 1 and min(self.volume_mult) >= 1, "volume_mult must be positive")
        need(0 <= self.opacity_threshold < 1, "opacity_threshold must be in [0,1)")
        need(self.image % self.patch == 0, "image must be a multiple of patch")
        need(self.vit_dim % self.vit_heads == 0, "vit_dim must be a multiple of vit_heads")
        need(self.volume % 2 ** (len(self.volume_mult) - 1) == 0, "volume must be divisible by 2 for every level of volume_mult but one")
        for name, ch in (("volume_ch", self.volume_ch), ("voxel_ch", self.voxel_ch), ("voxel_ch + vit_dim", self.voxel_ch + self.vit_dim * self.use_projected)):
            need(ch % self.groups == 0, f"{name} must be a multiple of groups")
        need(0 <= self.sh_degree <= 3, "sh_degree must be 0 to 3")
        need(self.fine_count >= 1, "fine_count must be at least 1")
        need(1 <= self.views <= 16, "views must be 1 to 16")
        need(self.refine_out_kernel in (1, 3), "refine_out_kernel must be 1 or 3")
        for name, allowed in (("levels", ("fine", "skeletal", "coarse")), ("selection", ("gumbel", "sigmoid", "ste", "opacity")),
                              ("view_weight", ("depth", "distance")), ("rebase", ("rotate", "move"))):
            need(getattr(self, name) in allowed, f"{name} must be one of {', '.join(allowed)}")
        return self

    def with_fields(self, assignments):
        """["fine_count=1", "levels=coarse", ...] -> a changed copy, values parsed by the field's type."""
        changes = {}
        for text in assignments:
            name, value = text.split("=", 1)
            if name not in asdict(self):
                raise ValueError(f"no field {name}")
            old = getattr(self, name)
            if isinstance(old, bool):
                if value not in ("true", "false"):
                    raise ValueError(f"{name} must be true or false")
                changes[name] = value == "true"
            elif isinstance(old, tuple):
                changes[name] = tuple(int(v) for v in value.split(","))
            else:
                changes[name] = type(old)(value)
        return replace(self, **changes).check()


CONFIGS = {
    "paper": Config(),
    # A size that two CPU cores train: 16 M parameters.
    "small": Config(image=128, patch=8, vit_dim=384, vit_depth=4, vit_heads=6, vit_pos_grid=16, volume=32, volume_ch=64,
                    voxel_ch=128, voxel_levels=1, fine_dim=256, fine_count=8, groups=16),
    # Forward and backward take a second; odd enough that a transposed axis or a hard-coded size shows.
    "tiny": Config(image=48, views=3, patch=8, vit_dim=24, vit_depth=2, vit_heads=3, vit_pos_grid=4, volume=10, volume_ch=16,
                   voxel_ch=24, voxel_levels=2, fine_dim=32, fine_count=3, groups=8),
    # For interpreters: everything is there, almost nothing of it.
    "micro": Config(image=16, views=2, patch=8, vit_dim=12, vit_depth=1, vit_heads=2, vit_pos_grid=3, volume=4, volume_ch=4,
                    voxel_ch=8, voxel_levels=1, fine_dim=8, fine_count=2, groups=2),
}
