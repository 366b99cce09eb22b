"""Write reference vectors for LaRa, GenDen and VS-Splat with GenDen: random weights, pictures, every stage, gradients.

    python3 make_published.py --system lara|genden|vsplat+genden [--size tiny] [--seed 0] [--residual] [--suffix S] --output DIR

The same arguments give the same bytes. float64 throughout, from weights and inputs that float32 holds; stored as float32,
indices as int64. In DIR:

  SYSTEM_SIZE.ckpt         the weights as the published files hold them: a Lightning checkpoint (torch.save), keys with "net.",
                           with an optimiser, schedulers, callbacks and loops beside them, storages marked cuda:0
  SYSTEM_SIZE.safetensors  input.{images,c2w,K}; input.orders (levels x 4), which permutation of the curves each level takes (the
                           published code draws it at random); stage.*, named as in the specification's `trace`;
                           cotangent.{coarse,final}.*; cograd.coarse.PARAMETER: those of the coarse primitives; cograd.final.*: of
                           the final ones, through the coarse drawings too; cograd.fixed.*: of the final ones, drawings held
                           constant; of lara also novel.* (the views beside the input), loss and grad.* (of the product's loss);
                           metadata: "config" (as model files have it), "views", "seed"

No discrete choice lies close to its threshold: the seed is moved by 1000 until all `margins` exceed their limits. (Single
pixel-primitive pairs near 1/255 remain, as in every drawing.)
"""
import argparse
import collections
import io
import json
import math
import os
import zipfile

import torch

import genden_reference as genden
import lara_reference as lara
import loss_reference
import make_golden
import object_views
import safetensors_file
import serialisation
import splat3d_reference as splat3d
import vsplat_reference as ref

FIELDS = splat3d.GAUSSIAN_FIELDS
WHITE = (1.0, 1.0, 1.0)


# ------------------------------------------------------------------------------------ random weights

def spread(linear, groups, x):
    """Rescale the last Linear of a head so that what it gives for the inputs x has the wanted mean and deviation in each
    group of outputs: [(slice, mean, deviation)]."""
    with torch.no_grad():
        y = linear(x)
        for rows, mean, deviation in groups:
            k = deviation / y[:, rows].std()
            linear.weight[rows] *= k
            linear.bias[rows] = (linear.bias[rows] - y[:, rows].mean()) * k + mean


def primitive_groups(sh, scale, offset=3):
    """Columns of (offset,) SH, opacity, scale, rotation."""
    at, out = offset, []
    if offset:
        out.append((slice(0, offset), 0.0, 1.2))
    for width, mean, deviation in ((sh, 0.1, 0.4), (1, 1.5, 3.5), (scale, 0.8, 0.4), (4, 0.0, 1.0)):
        out.append((slice(at, at + width), mean, deviation))
        at += width
    return out


def randomise(model, seed):
    """Biases and norms away from 0 and 1; GELU far enough out that an approximation shows."""
    torch.manual_seed(seed)
    for p in model.parameters():
        if p.dim() == 1:
            p.data += 0.1 * torch.randn_like(p)
    for name, p in model.named_parameters():
        if name.endswith(("mlp.fc1.weight", "mlp.0.fc1.weight")) or ".layers." in name and name.endswith("mlp.0.weight"):
            p.data *= 3
        if name == "volume_network.conv_in.0.weight":
            p.data *= 0.02
    return model


def settle_heads(case):
    """Give every head outputs of a useful size, from the first to the last."""
    model, run = case.model, case.run
    cfg, d, held = model.cfg, getattr(model, "dec", None), {}
    if isinstance(model, lara.LaRa):
        blank = torch.zeros(case.views, cfg.image, cfg.image).double()
        nothing = {"drawings": {"image": blank[..., None].expand(-1, -1, -1, 3), "alpha": blank, "depth": blank}}
        volume = run(**nothing, **({} if d is None else {"selection": []}))["volume"]
        c, wide = model.decoder.mlp_coarse, model.decoder.mlp_coarse[4].out_features // cfg.primitives
        h = torch.relu(c[2](torch.relu(c[0](volume))))
        for k in range(cfg.primitives):
            rows = slice(k * wide, (k + 1) * wide)
            spread(c[4], [(slice(rows.start + g.start, rows.start + g.stop), m, s) for g, m, s in primitive_groups(cfg.sh_dim, cfg.scale_dim)], h)
        widen_gap(c[4], cfg, model.coarse(volume).opacities)
        t = run(**({} if d is None else {"selection": []}))
        held = {"drawings": case.drawings(t)}
        feature = model.decoder.norm(t["volume"][t["fine.index"] // cfg.primitives])[:, None]
        x = torch.relu(model.decoder.mlp_fine[0](model.decoder.cross_att(feature, t["fine.samples"])[:, 0]))
        groups = [(slice(cfg.fine_features, cfg.fine_features + cfg.sh_dim), 0.0, 0.2)]
        spread(model.decoder.mlp_fine[2], groups + ([(slice(0, cfg.fine_features), 0.0, 1.0)] if cfg.fine_features else []), x)
    if d is None:
        return
    held["score"] = run(**held, selection=[])["score"]
    for s, level in enumerate(d):
        x = run(**held)[f"level.{s}.block{d.cfg.depths[s] - 1}.output"]
        spread(level.up.delta_x[2], [(slice(None), 0.0, 0.4)], level.up.delta_x[:2](genden.plain_norm(x)))
        x = run(**held)[f"level.{s}.feature"]
        if isinstance(level.mask, genden.Confidence):
            spread(level.mask.net[2], [(slice(None), 0.0, 1.5)], level.mask.net[:2](x))
        groups = primitive_groups(3 * (d.cfg.sh_degree + 1) ** 2, 3, 0)
        groups[1:3] = [(groups[1][0], 1.5, 1.5), (groups[2][0], 1.6, 0.3)]
        spread(level.head.feat2attr[2], groups, level.head.feat2attr[:2](x))


def widen_gap(last, cfg, opacities):
    """Move the opacities' bias so that the threshold falls into the widest gap among a tenth to a third of them."""
    raw = torch.logit(opacities.detach()).sort()[0]
    lo, hi = len(raw) // 10, len(raw) // 3
    i = lo + int((raw[lo + 1:hi + 1] - raw[lo:hi]).argmax())
    shift = math.log(cfg.opacity_threshold / (1 - cfg.opacity_threshold)) - ((raw[i] + raw[i + 1]) / 2).item()
    at = 3 + cfg.sh_dim
    wide = last.out_features // cfg.primitives
    for k in range(cfg.primitives):
        last.bias.data[k * wide + at] += shift


def margins(model, t):
    """How far every discrete choice is from falling the other way, each relative to its own scale, and the least allowed."""
    out, d = {}, getattr(model, "dec", None)
    cfg = model.cfg
    if isinstance(model, lara.LaRa):
        raw, at = torch.logit(t["coarse.opacities"]), math.log(cfg.opacity_threshold / (1 - cfg.opacity_threshold))
        out["opacity threshold (logit)"] = ((raw - at).abs().min().item(), 1e-4)
    else:
        out["voxel selection (logit)"] = (t["logits"].abs().min().item(), 1e-4)
        raw = torch.logit(t["base.opacities"]) - math.log(d.cfg.opacity_threshold / (1 - d.cfg.opacity_threshold))
        out["opacity threshold (logit)"] = (raw.abs().min().item(), 1e-4)
    if d is not None:
        score = t["score"][t["fine.index" if isinstance(model, lara.LaRa) else "kept.index"]].sort(descending=True)[0]
        k = d.cfg.top_k
        if k < len(score):
            out["top k (relative)"] = (((score[k - 1] - score[k]) / score[k]).item(), 3e-4)
        xyz = t["kept.means"] if isinstance(model, lara.LaRa) else t["base.means"][t["kept.index"]]
        xyz, cell = xyz[t["selected"]], d.cfg.cell
        for s in range(len(d)):
            x = (xyz - xyz.min(0)[0]) / cell
            x = x[x > 0]
            out[f"cells of level {s}"] = ((x - x.round()).abs().min().item(), 2e-4)
            if f"level.{s}.confidence" in t:
                p = t[f"level.{s}.confidence"].sort(descending=True)[0]
                k = len(p) - len(t[f"level.{s}.leaf"])
                out[f"confidence of level {s} (relative)"] = (((p[k - 1] - p[k]) / p[k]).item(), 1e-4)
            on = torch.ones(len(t[f"level.{s}.xyz"]), dtype=torch.bool)
            on[t[f"level.{s}.leaf"]] = False
            xyz, cell = t[f"level.{s}.xyz"][on], cell / d.cfg.stride
    return out


def borders(case, t):
    """How far the places at which pictures are sampled are from the pixels' borders, where the samples have no derivative, in pixels. A
    position in float32 is good to 2e-6 of them."""
    if not isinstance(case.model, lara.LaRa):
        return {}
    n = case.views
    xy, _ = ref.project(t["coarse.means"][t["fine.index"]], torch.inverse(case.c2w[:n]), case.K[:n])
    return {"pixels' borders": ((xy - xy.round()).abs().min().item(), 8e-6)}


# ------------------------------------------------------------------------------------------- files

def checkpoint(path, state, parameters):
    """A file as Lightning 2.1.3 under torch 2.1 leaves it, at a small scale. `parameters`: names that the optimiser has."""
    weights = collections.OrderedDict((f"net.{k}", v.clone()) for k, v in state.items())
    weights._metadata = collections.OrderedDict([("", {"version": 1}), ("loss", {"version": 1}), ("net", {"version": 1})])
    names = list(parameters)
    some = {i: {"step": torch.tensor(1000.0), "exp_avg": torch.full_like(state[k], 1e-3), "exp_avg_sq": torch.full_like(state[k], 1e-6)}
            for i, k in enumerate(names[:3])}
    group = {"lr": 1e-4, "betas": (0.9, 0.95), "eps": 1e-08, "amsgrad": False, "foreach": None, "maximize": False,
             "capturable": False, "differentiable": False, "fused": None, "initial_lr": 4e-4}
    half = len(names) // 2
    progress = {"total": {"ready": 1000, "completed": 1000, "started": 1000, "processed": 1000},
                "current": {"ready": 20, "completed": 20, "started": 20, "processed": 20}}
    key = "ModelCheckpoint{'monitor': None, 'mode': 'min', 'every_n_train_steps': 0, 'every_n_epochs': 2, 'train_time_interval': None}"
    everything = {
        "epoch": 49, "global_step": 1000, "pytorch-lightning_version": "2.1.3", "state_dict": weights,
        "loops": {"fit_loop": {"state_dict": {}, "epoch_loop.state_dict": {"_batches_that_stepped": 1000},
                               "epoch_loop.batch_progress": {**progress, "is_last_batch": True}, "epoch_progress": progress},
                  "validate_loop": {"state_dict": {}}},
        "callbacks": {key: {"monitor": None, "best_model_score": None, "best_model_path": "epoch=49.ckpt", "current_score": None,
                            "dirpath": "log", "best_k_models": {}, "kth_best_model_path": "", "kth_value": torch.tensor(math.inf), "last_model_path": ""}},
        "optimizer_states": [{"state": some, "param_groups": [{**group, "weight_decay": 0.05, "params": list(range(half))},
                                                              {**group, "weight_decay": 0.0, "params": list(range(half, len(names)))}]}],
        "lr_schedulers": [{"warmup_iters": 1000, "max_iters": 99999, "initial_lr": 1e-10, "base_lrs": [4e-4, 4e-4], "last_epoch": 1000,
                           "verbose": False, "_step_count": 1001, "_get_lr_called_within_step": False, "_last_lr": [4e-4, 4e-4]}],
    }
    registry = torch.serialization._package_registry
    mark = (5, lambda storage: "cuda:0", lambda storage, location: None)        # they were trained on one
    registry.insert(0, mark)
    buffer = io.BytesIO()
    try:
        torch.save(everything, buffer)
    finally:
        registry.remove(mark)
    with zipfile.ZipFile(buffer, "a") as z:                                     # two entries that newer versions add
        for name, text in (("archive/byteorder", "little"), ("archive/.data/serialization_id", "0" * 40)):
            if name not in z.namelist():
                z.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), text)
    with open(path, "wb") as f:
        f.write(buffer.getvalue())


def save(path, tensors, metadata=None):
    safetensors_file.save_safetensors(path, {k: v if v.dtype == torch.int64 else v.detach().float() for k, v in tensors.items()}, metadata)


# ----------------------------------------------------------------------------------------- the cases

class Case:
    def __init__(self, system, size, seed, residual):
        torch.manual_seed(seed)
        self.system, self.seed = system, seed
        self.model, self.config = genden.build(system, size, residual)
        randomise(self.model, seed).double()
        cfg, self.views = self.model.cfg, self.model.cfg.views
        self.c2w, self.K = (x.double() for x in object_views.orbit_cameras(self.views + 1, cfg, seed=seed))
        self.images = object_views.checked_ball(self.c2w.float(), self.K.float(), cfg.image).double()
        self.orders = serialisation.random_perms(seed) if system != "lara" else None
        if system == "vsplat+genden":
            make_golden.settle(self.model, self.run(selection=[]))
            self.float32()
            head, at = self.model.predictor.fine_predictor, 3 + cfg.sh_dim              # so that some of its primitives are transparent
            opacity = [slice(m * (at + 8) + at, m * (at + 8) + at + 1) for m in range(cfg.fine_count)]
            spread(head[-1], [(rows, 1.0, 3.0) for rows in opacity], head[:-1](self.run(selection=[])["refined"]))
        settle_heads(self)
        self.float32()

    def float32(self):
        """What the file will hold."""
        self.model.float().double()

    def run(self, **more):
        """A forward pass without gradients -> its trace."""
        t = {}
        with torch.no_grad():
            self.forward(trace=t, **more)
        return t

    def forward(self, **more):
        if self.orders is not None:
            more.setdefault("orders", self.orders)
        n = self.views
        return self.model(self.images[:n], self.c2w[:n], self.K[:n], **more)

    @staticmethod
    def drawings(t):
        return {k[8:]: v for k, v in t.items() if k.startswith("drawing.")}

    def draw(self, g):
        return self.model.draw(g, self.c2w, self.K, WHITE)


def make_case(system, size, seed, residual):
    for attempt in range(20):
        case = Case(system, size, seed + 1000 * attempt, residual)
        t = case.run()
        m = {**margins(case.model, t), **borders(case, t)}
        if all(got > least for got, least in m.values()):
            return case, t
    raise SystemExit("no seed with clear choices found: " + json.dumps(m))


def gradients(case, t):
    """Cotangents on the coarse and final fields, and the parameters' gradients. The choices are held as in `t`."""
    model, out = case.model, {}
    fixed = {"selection": t["selected"], "score": t["score"]} if "selected" in t else {}
    gen = torch.Generator().manual_seed(case.seed)
    held = {} if case.system == "vsplat+genden" else {"drawings": case.drawings(t)}
    runs = [("coarse", held), ("final", {})] + ([("fixed", held)] if held else [])
    for name, more in runs:
        model.zero_grad(set_to_none=True)
        results = case.forward(**fixed, **more)
        g = results[0] if name == "coarse" else results[-1]
        which = "coarse" if name == "coarse" else "final"
        for f in FIELDS:
            key = f"cotangent.{which}.{f}"
            if key not in out:
                out[key] = (torch.randn(getattr(g, f).shape, generator=gen) * 0.1).double()
        torch.autograd.backward(g.fields(), [out[f"cotangent.{which}.{f}"] for f in FIELDS])
        out.update({f"cograd.{name}.{k}": p.grad.clone() for k, p in model.named_parameters() if p.grad is not None})
    model.zero_grad(set_to_none=True)
    return out


def view_losses(case, t):
    """What the product trains LaRa on, view by view where the published loss has them side by side: the loss of all views, novel ones
    too, and the parameters' gradients."""
    model = case.model
    model.zero_grad(set_to_none=True)
    total = 0.0
    for i, g in enumerate(case.forward()):
        m = case.draw(g)
        for got, want in zip(m["image"], case.images):
            total = total + (((got - want) ** 2).mean() + 0.5 * (1 - loss_reference.ssim(got[None], want[None]))) / len(case.images)
        if i == 0 and "distortion" in m:
            total = total + 1000 * m["distortion"].mean()
            total = total + 0.2 * ((1 - (m["normal"] * m["depth_normal"]).sum(-1)) * m["alpha"].detach()).mean()
    total.backward()
    out = {"loss": total.detach().reshape(1)}
    out.update({f"grad.{k}": p.grad.clone() for k, p in model.named_parameters() if p.grad is not None})
    model.zero_grad(set_to_none=True)
    return out


def write(case, t, path):
    """What a drawing is beside image, alpha and depth is for the loss alone, which is that of the product."""
    checkpoint(path + ".ckpt", {k: v.detach().float() for k, v in case.model.state_dict().items()}, dict(case.model.named_parameters()))
    out = {f"input.{k}": v[:case.views] for k, v in {"images": case.images, "c2w": case.c2w, "K": case.K}.items()}
    out.update({f"stage.{k}": v for k, v in t.items() if not k.startswith("drawing.") or k.split(".")[1] in ("image", "alpha", "depth")})
    out.update(gradients(case, t))
    config = json.loads(case.config)
    flat = dict(config["backbone"])                             # as model files have it
    for k, v in config.get("densify", {}).items():
        if k != "sh_degree" and (k != "opacity_threshold" or case.system == "vsplat+genden"):
            flat[f"densify.{k}"] = ",".join(v) if k == "orders" else v
    meta = {"config": json.dumps(flat), "views": case.views}
    if case.orders is not None:
        out["input.orders"] = torch.tensor(case.orders)
        meta["seed"] = case.seed
    if case.system == "lara":
        out.update({f"novel.{k}": v[case.views:] for k, v in {"images": case.images, "c2w": case.c2w, "K": case.K}.items()})
        out.update(view_losses(case, t))
    save(path + ".safetensors", out, meta)
    print(f"{os.path.basename(path)}, seed {case.seed}: {lara.count(case.model):,} parameters, {len(t['final.means'])} final primitives")


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--system", required=True, choices=("lara", "genden", "vsplat+genden"))
    ap.add_argument("--size", default="tiny", choices=("tiny", "micro", "tiny_gaussian", "micro_gaussian"), help="those with _gaussian: of lara alone; micro: not of vsplat+genden")
    ap.add_argument("--seed", type=int, default=0)
    ap.add_argument("--residual", action="store_true", help="GenDen's second published model")
    ap.add_argument("--suffix", default="", help="of the files' names")
    ap.add_argument("--output", required=True)
    a = ap.parse_args()
    torch.set_num_threads(1)                                    # the order of sums, and so the bytes
    os.makedirs(a.output, exist_ok=True)
    case, t = make_case(a.system, a.size, a.seed, a.residual and a.system == "genden")
    write(case, t, os.path.join(a.output, f"{a.system}_{a.size}" + ("_residual" if a.residual else "") + a.suffix))


if __name__ == "__main__":
    main()
