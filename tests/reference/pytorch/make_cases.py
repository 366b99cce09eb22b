"""Write the golden vectors that tests read, one file a case, in one process (importing PyTorch is what takes time).

    python3 make_cases.py DIR micro      the committed ones: two with gradients, the other systems' and the extensions' small ones, and
                                         the lists of the published sizes' parameters
    python3 make_cases.py DIR train      tiny with all gradients: two seeds, ten steps from one of them, and some variants
    python3 make_cases.py DIR train_slow the other variants, and none selected
    python3 make_cases.py DIR tiny       two seeds, 1 and 6 views, noise, every variant of the configuration, none selected,
                                         a U-Net of one level and of three, and one of many channels; with gradients where they
                                         are micro: those, and fewer levels with every selection; and the other systems' and the
                                         extensions' larger ones
    python3 make_cases.py DIR tiny_slow  two seeds more of every system's and extension's
"""
import glob
import os
import sys

import genden_reference
import lara_reference
import make_extensions
import make_golden
import make_published

MICRO = {
    "micro": [],
    "micro_noise": ["--noise"],
}

TINY = {
    "tiny": [],
    "tiny_seed1": ["--seed", "1"],
    "tiny_views1": ["--views", "1"],
    "tiny_views6": ["--views", "6"],
    "tiny_noise": ["--noise"],
    "tiny_noise_seed1": ["--noise", "--seed", "1"],
    "tiny_coarse": ["--set", "levels=coarse"],
    "tiny_skeletal": ["--set", "levels=skeletal"],
    "tiny_sigmoid": ["--set", "selection=sigmoid"],
    "tiny_ste": ["--set", "selection=ste"],
    "tiny_opacity": ["--set", "selection=opacity", "--set", "opacity_threshold=0.1"],
    "tiny_unprojected": ["--set", "use_projected=false"],
    "tiny_fine1": ["--set", "fine_count=1"],
    "tiny_mirrored": ["--set", "negate_camera_centre=true"],
    "tiny_paper": ["--set", "view_weight=distance", "--set", "voxel_levels=1", "--set", "refine_out_kernel=3",
                   "--set", "sample_half_pixel=false"],
    "tiny_empty": ["--empty"],
    "micro_levels1": ["--config", "micro", "--set", "volume_mult=2"],
    "micro_levels3": ["--config", "micro", "--set", "volume_mult=1,3,2"],
    # Wide enough for the kernels that only many channels choose (Winograd).
    "micro_wide": ["--config", "micro", "--set", "volume=6", "--set", "volume_ch=32", "--set", "vit_dim=36", "--set", "voxel_ch=36",
                   "--set", "fine_dim=40"],
    "micro_coarse": ["--config", "micro", "--set", "levels=coarse"],
    "micro_skeletal": ["--config", "micro", "--noise", "--set", "levels=skeletal"],
    "micro_skeletal_sigmoid": ["--config", "micro", "--set", "levels=skeletal", "--set", "selection=sigmoid"],
    "micro_skeletal_ste": ["--config", "micro", "--set", "levels=skeletal", "--set", "selection=ste"],
    "micro_skeletal_opacity": ["--config", "micro", "--set", "levels=skeletal", "--set", "selection=opacity",
                               "--set", "opacity_threshold=0.1"],
}

VARIANTS = {
    "coarse": ["--set", "levels=coarse"],
    "skeletal": ["--set", "levels=skeletal"],
    "sigmoid": ["--set", "selection=sigmoid"],
    "ste": ["--set", "selection=ste"],
    "opacity": ["--set", "selection=opacity", "--set", "opacity_threshold=0.1"],
    "unprojected": ["--set", "use_projected=false"],
    "fine1": ["--set", "fine_count=1"],
    "fine4": ["--set", "fine_count=4"],
    "mirrored": ["--set", "negate_camera_centre=true"],
    "distance": ["--set", "view_weight=distance"],
    "kernel3": ["--set", "refine_out_kernel=3"],
    "no_half_pixel": ["--set", "sample_half_pixel=false"],
    "empty": ["--empty"],
    "empty_sigmoid": ["--empty", "--set", "selection=sigmoid"],
    "empty_ste": ["--empty", "--set", "selection=ste"],
    "empty_opacity": ["--empty", "--set", "selection=opacity"],
}
TRAIN = {
    "train": [],
    "train_steps": ["--seed", "1", "--steps", "10"],
    **{f"train_{name}": options for name, options in VARIANTS.items()},
}
QUICK = ["train", "train_steps", "train_ste", "train_mirrored", "train_empty_ste"]
GROUPS = {
    "micro": (MICRO, ["--config", "micro"]),
    "tiny": (TINY, ["--config", "tiny"]),
    "tiny_slow": ({"tiny_seed2": ["--seed", "2"]}, ["--config", "tiny"]),
    "train": ({name: TRAIN[name] for name in QUICK}, ["--config", "tiny", "--noise"]),
    "train_slow": ({name: options for name, options in TRAIN.items() if name not in QUICK}, ["--config", "tiny", "--noise"]),
}

PUBLISHED = {                                             # the last file that each writes: the system, the size, more
    "micro": {
        "lara_micro": ["lara", "micro"],
        "genden_micro": ["genden", "micro"],
    },
    "tiny": {
        "lara_tiny": ["lara", "tiny", "--seed", "2000"],  # the first that is far from all thresholds
        "lara_tiny_gaussian": ["lara", "tiny_gaussian"],
        "lara_micro_gaussian": ["lara", "micro_gaussian"],
        "genden_tiny": ["genden", "tiny", "--seed", "1000"],
        "genden_tiny_residual": ["genden", "tiny", "--residual", "--seed", "1000"],
        "vsplat+genden_tiny": ["vsplat+genden", "tiny"],
    },
    "tiny_slow": {
        "lara_tiny_seed1": ["lara", "tiny", "--seed", "1", "--suffix", "_seed1"],
        "lara_tiny_seed2": ["lara", "tiny", "--seed", "2", "--suffix", "_seed2"],
        "genden_tiny_seed1": ["genden", "tiny", "--seed", "1001", "--suffix", "_seed1"],
        "genden_tiny_seed2": ["genden", "tiny", "--seed", "2", "--suffix", "_seed2"],
        "genden_tiny_residual_seed1": ["genden", "tiny", "--residual", "--seed", "1001", "--suffix", "_seed1"],
        "genden_tiny_residual_seed2": ["genden", "tiny", "--residual", "--seed", "2", "--suffix", "_seed2"],
        "vsplat+genden_tiny_seed1": ["vsplat+genden", "tiny", "--seed", "5001", "--suffix", "_seed1"],
        "vsplat+genden_tiny_seed2": ["vsplat+genden", "tiny", "--seed", "5002", "--suffix", "_seed2"],
    },
}
EXTENSIONS = {                                            # the last file that each writes: what, the size, which part
    "micro": {
        "dinov3_micro_wide": ["dinov3", "micro", "small"],
        "share_micro_aligned": ["share", "micro", "small"],
    },
    "tiny": {
        "dinov3_micro_model": ["dinov3", "micro", "large"],
        "share_micro_model": ["share", "micro", "large"],
        "dinov3_tiny_model": ["dinov3", "tiny", "all"],
        "share_tiny_model": ["share", "tiny", "all"],
    },
    "tiny_slow": {
        f"{what}_tiny_seed{i}_model": [what, "tiny", "all", "--seed", str(10 * i), "--suffix", f"_seed{i}"] for what in ("dinov3", "share") for i in (1, 2)
    },
}


def run(module, *arguments):
    sys.argv = [module.__file__, *arguments]
    module.main()


def make_parameters(folder):
    """The lists of the published sizes' parameters, where they are not there."""
    for system in ("lara", "genden"):
        path = os.path.join(folder, system + "_parameters.txt")
        if not os.path.exists(path):
            model, _ = genden_reference.build(system, "published")
            with open(path, "w") as f:
                for name, shape, kind in lara_reference.parameters(model):
                    f.write(f"{name} {' x '.join(map(str, shape))} {kind}\n")
                f.write(f"{lara_reference.count(model):,} parameters\n")


def newest_source():
    return max(map(os.path.getmtime, glob.glob(os.path.join(os.path.dirname(os.path.abspath(__file__)), "*.py"))))


def make_systems(folder, size):
    def due(name):
        path = os.path.join(folder, name + ".safetensors")
        return not os.path.exists(path) or size != "micro" and os.path.getmtime(path) < newest_source()  # what is committed stays

    for name, (system, edge, *more) in PUBLISHED.get(size, {}).items():
        if due(name):
            run(make_published, "--system", system, "--size", edge, "--output", folder, *more)
    for name, (what, edge, part, *more) in EXTENSIONS.get(size, {}).items():
        if due(name):
            run(make_extensions, "--what", what, "--size", edge, "--part", part, "--output", folder, *more)


def main():
    folder, size = sys.argv[1], sys.argv[2]
    cases, common = GROUPS[size]
    os.makedirs(folder, exist_ok=True)
    if size == "micro":
        make_parameters(folder)
    make_systems(folder, size)
    sources = newest_source()
    for name, options in cases.items():
        path = os.path.join(folder, name + ".safetensors")
        if os.path.exists(path) and os.path.getmtime(path) > sources:
            continue
        sys.argv = ["make_golden.py", path + ".tmp", *common, *options]
        if name.startswith("tiny"):                       # their gradients take long
            sys.argv.append("--no-grad")
        print(f"{name}: ", end="", flush=True)
        make_golden.main()
        os.replace(path + ".tmp", path)


if __name__ == "__main__":
    main()
