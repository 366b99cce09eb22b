"""Write reference vectors of the two extensions: share_reference.py (Plücker maps predicted from the features) and
dinov3_reference.py (the encoder of the paper's table II).

    python3 make_extensions.py --what share|dinov3 --output DIR [--size tiny|micro] [--seed 0] [--part small|large]

Random weights and inputs, every stage, gradients; float64 throughout, stored as float32, as make_golden.py does; the same
seed gives the same bytes on one machine. Files written, SIZE in their names before what they are, each with its configuration (JSON, all
fields in one object) in the metadata; with --part small only those marked *, with --part large only the others:

  share_predictor.safetensors *          the predictor alone, `views` views
  share_pair.safetensors *               2 views (the two values of share_cross_mask agree)
  share_aligned.safetensors *            `views` views, share_cross_mask = aligned
  share_model.safetensors                all of VS-Splat with the predictor, noise on the given cameras
  dinov3_square *, _wide.safetensors *   the encoder alone; square pictures; pictures of 3 x 5 patches
  dinov3_bias.safetensors                with biases of queries and values, and Meta's rounded periods; twice the width
  dinov3[_bias]_{timm,meta}.pth          the weights of `square` * and `bias` under the bare names of the two, as torch.save writes
                                         them; in `meta` without biases, bias and mask are 0 as in the published file
  dinov3_model.safetensors               all of VS-Splat with this encoder

Tensor names: input.*, weight.* (state dict; the predictor's own names start with `share.`, the encoder's here with nothing, in a
model with `encoder.model.`), stage.* (the reference's trace), cotangent.* and cograd.* (the fixed cotangent of each output, and what
it gives every weight and, for `share_predictor*`, the input features). In the models also render.{coarse,final}.*, loss (share: the
sum, and loss.ray), grad.* (of the loss, through the rasteriser).
share_model's inputs: c2w and K of the `views` input views and 2 novel ones, accurate; pose_noise (views,6); c2w_given, what the
network is given; plucker, of the accurate cameras: the ray loss's target.
"""
import argparse
import json
import os
from dataclasses import asdict, replace

import torch

import dinov3_reference as dinov3
import loss_reference
import make_golden as golden
import object_views
import safetensors_file
import share_reference as share
import splat3d_reference as splat3d
import vsplat_reference as ref

SIGMA = 0.05            # of the pose noise in share_model


def randomise(model, seed):
    """Weights with which a wrong constant shows: as make_golden's, and attention far from uniform."""
    torch.manual_seed(seed)
    for name, p in model.named_parameters():
        if name.endswith(("gamma_1", "gamma_2")):
            p.data = 0.2 + 0.8 * torch.rand_like(p)
        elif p.dim() == 1:
            p.data += 0.1 * torch.randn_like(p)
        elif name.endswith(("mlp.fc1.weight", "mlp.fc2.weight", "mlp.0.weight")):   # far enough out that one GELU is not the other
            p.data *= 3
        elif name.endswith(("qkv.weight", "q_proj.weight", "k_proj.weight")):
            p.data *= 1.5
        elif name.endswith("final_layer.linear.weight"):    # rays of about unit size, as a trained predictor's: the modulation cubes them
            p.data *= 0.3
        if name.endswith(("volume_network.conv_in.0.weight", "merge.weight", "reduce.2.weight", "reduce.2.bias", "reduce.5.weight", "reduce.5.bias")):
            p.data *= 0.02                                  # small enough that the epsilon of the norm behind it counts
    return model.float().double()                           # the file holds float32


def exact(t):
    """A float64 tensor with values that float32 holds."""
    return t.float().double()


def cotangents(outputs, scale):
    return {k: exact(torch.randn_like(v) * scale) for k, v in outputs.items()}


def pull_back(outputs, given, params, prefix=""):
    for p in params.values():
        p.grad = None
    torch.autograd.backward([outputs[k] for k in given], [given[k] for k in given])
    out = {f"cotangent.{k}": v for k, v in given.items()}
    out.update({f"cograd.{prefix}{k}": p.grad.clone() for k, p in params.items() if p.grad is not None})
    return out


def write(path, tensors, cfg, seed, **meta):
    tensors = {k: (v if v.dtype == torch.int64 else v.float()) for k, v in tensors.items()}
    safetensors_file.save_safetensors(path, tensors, {"config": json.dumps(asdict(cfg)), "seed": seed, **meta})
    print(f"{os.path.basename(path)}: {len(tensors)} tensors, {sum(v.numel() for v in tensors.values())} numbers")


# -------------------------------------------------------------------------------------- share

def predictor_case(cfg, seed, views):
    torch.manual_seed(seed)
    net = randomise(share.PluckerPredictor(cfg), seed)
    feats = exact(torch.randn(views, cfg.tokens, cfg.tokens, cfg.vit_dim, dtype=torch.float64)).requires_grad_()
    trace = {}
    rays = net(feats, trace)
    out = {"input.features": feats, **{f"weight.share.{k}": v.clone() for k, v in net.state_dict().items()}, **{f"stage.{k}": v for k, v in trace.items()}}
    out.update(pull_back({"plucker": rays}, cotangents({"plucker": rays}, 1.0), dict(net.named_parameters()), "share."))
    out["cograd.features"] = feats.grad
    return out


def model_case(model, cfg, seed, noise_on_cameras):
    """All of VS-Splat: stages, renderings, loss, its gradients and those of cotangents on the Gaussians."""
    n, temperature, background = cfg.views, 0.1, torch.tensor([1.0, 0.5, 0.0]).double()
    model = randomise(model, seed)
    c2w, K = (t.double() for t in object_views.orbit_cameras(n + 2, cfg, seed=seed))
    target = object_views.checked_ball(c2w.float(), K.float(), cfg.image).double()
    given, out = c2w[:n], {}
    if noise_on_cameras:
        xi = exact(share.draw_pose_noise(n, SIGMA, torch.Generator().manual_seed(seed)))
        given = exact(share.noisy_cameras(c2w[:n], xi))
        true = ref.plucker(c2w[:n], K[:n], cfg.tokens, cfg.patch)
        out.update({"input.pose_noise": xi, "input.c2w_given": given, "input.plucker": true})
    trace = {}
    with torch.no_grad():
        model(target[:n], given, K[:n], temperature, trace=trace)
    golden.settle(model, trace)
    model, trace = model.float().double(), {}
    coarse, final, coords = model(target[:n], given, K[:n], temperature, trace=trace)
    shots = {lev: golden.pictures(model, g, c2w, K, background) for lev, g in (("coarse", coarse), ("final", final))}
    levels = {"coarse": coarse} if cfg.levels == "coarse" else {"coarse": coarse, "final": final}
    fine = shots["final"][0] if len(levels) == 2 else None
    value = loss_reference.loss(shots["coarse"][0], fine, target)
    outputs = {f"{lev}.{f}": x for lev, g in levels.items() for f, x in zip(splat3d.GAUSSIAN_FIELDS, g.fields())}
    if noise_on_cameras:
        rays = share.ray_loss(model.plucker, true)
        value = share.loss(shots["coarse"][0], fine, target, model.plucker, true, cfg)
        out["loss.ray"], outputs["plucker"] = rays.reshape(1), model.plucker
    out.update({"input.images": target, "input.c2w": c2w, "input.K": K, "input.background": background, "loss": value.reshape(1)})
    out.update({f"weight.{k}": v.clone() for k, v in model.state_dict().items()})
    out.update({f"stage.{k}": v for k, v in trace.items()})
    out.update({f"render.{lev}.{name}": part for lev, parts in shots.items() for name, part in zip(("image", "alpha", "depth"), parts)})
    value.backward(retain_graph=True)
    out.update({f"grad.{k}": p.grad.clone() for k, p in model.named_parameters() if p.grad is not None})
    out.update(pull_back(outputs, cotangents(outputs, 1e-3), dict(model.named_parameters())))
    print(f"  {len(coords)} of {cfg.volume ** 3} voxels selected, {len(final.means)} Gaussians, loss {value.item():.6f}")
    return out, {"temperature": temperature, "views": n}


def make_share(cfg, seed, at, small, large):
    if small:
        write(at("predictor"), predictor_case(cfg, seed, cfg.views), cfg, seed, views=cfg.views)
        write(at("pair"), predictor_case(cfg, seed + 1, 2), cfg, seed + 1, views=2)
        aligned = replace(cfg, share_cross_mask="aligned", views=min(cfg.share_max_views, max(3, cfg.views)))
        write(at("aligned"), predictor_case(aligned, seed + 2, aligned.views), aligned, seed + 2, views=aligned.views)
    if large:
        torch.manual_seed(seed)
        out, meta = model_case(share.VSplatShare(cfg), cfg, seed, True)
        write(at("model"), out, cfg, seed, sigma=SIGMA, pose_noise_frame="world", **meta)


# ------------------------------------------------------------------------------------- dinov3

def encoder_case(cfg, seed, height, width, views=2):
    torch.manual_seed(seed)
    net = randomise(dinov3.Dinov3(cfg), seed)
    images = exact(torch.rand(views, height, width, 3, dtype=torch.float64))
    trace = {}
    feats = net(images, trace)
    out = {"input.images": images, **{f"weight.{k}": v.clone() for k, v in net.state_dict().items()}, **{f"stage.{k}": v for k, v in trace.items()}, "stage.features": feats}
    out.update(pull_back({"features": feats}, cotangents({"features": feats}, 1.0), dict(net.named_parameters())))
    return out, net


def make_dinov3(cfg, seed, at, small, large):
    p = cfg.patch
    biased = replace(cfg, vit_dim=2 * cfg.vit_dim, vit_qkv_bias=True, vit_rope_periods="bf16")     # periods 1 and 10 alone would survive the rounding
    cases = [("square", cfg, seed, cfg.image, cfg.image), ("wide", cfg, seed + 1, 3 * p, 5 * p)] if small else []
    cases += [("bias", biased, seed + 2, 5 * p, 2 * p)] if large else []
    for name, c, seed_, h, w in cases:
        out, net = encoder_case(c, seed_, h, w)
        write(at(name), out, c, seed_)
        if name != "wide":
            stem = "" if name == "square" else "bias_"
            state = net.state_dict()
            meta = dinov3.to_meta(state, c)
            if name == "square":
                meta = {k: torch.zeros_like(v) if k.endswith("bias_mask") else v for k, v in meta.items()}
            for naming, tensors in (("timm", state), ("meta", meta)):
                torch.save({k: v.float() for k, v in tensors.items()}, at(stem + naming).replace(".safetensors", ".pth"))
    if large:
        torch.manual_seed(seed)
        out, meta = model_case(dinov3.VSplatDinov3(cfg), cfg, seed, False)
        write(at("model"), out, cfg, seed, **meta)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--what", required=True, choices=("share", "dinov3"))
    ap.add_argument("--size", default="tiny", choices=("tiny", "micro"))
    ap.add_argument("--seed", type=int, default=0)
    ap.add_argument("--output", metavar="DIR", required=True)
    ap.add_argument("--suffix", default="", help="of the size in the files' names")
    ap.add_argument("--part", default="all", choices=("all", "small", "large"))
    a = ap.parse_args()
    torch.set_num_threads(1)
    cfg = (share if a.what == "share" else dinov3).CONFIGS[a.size]
    os.makedirs(a.output, exist_ok=True)
    at = lambda name: os.path.join(a.output, f"{a.what}_{a.size}{a.suffix}_{name}.safetensors")
    (make_share if a.what == "share" else make_dinov3)(cfg, a.seed, at, a.part != "large", a.part != "small")


if __name__ == "__main__":
    main()
