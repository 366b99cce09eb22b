#!/usr/bin/env python3
"""make_checkpoints.py OUT MODEL.safetensors OTHER.safetensors: the weights of both model files as torch.save leaves them, in every way that
`vsplat weights import` reads and in some that it refuses. MODEL is of a named configuration, OTHER of none."""
import collections
import math
import sys

import torch

import safetensors_file


def read(path):
    return collections.OrderedDict(safetensors_file.load_safetensors(path)[0])


def lightning(state):
    """What Lightning 2.1 writes beside the state dict, at a small scale."""
    weights = collections.OrderedDict(state)
    weights._metadata = collections.OrderedDict([("", {"version": 1}), ("net", {"version": 1})])
    some = {i: {"step": torch.tensor(1000.0), "exp_avg": torch.full_like(v, 1e-3), "exp_avg_sq": torch.full_like(v, 1e-6)}
            for i, v in enumerate(list(state.values())[:3])}
    group = {"lr": 1e-4, "betas": (0.9, 0.95), "eps": 1e-08, "amsgrad": False, "foreach": None, "params": list(range(3))}
    progress = collections.defaultdict(int, ready=1000, completed=1000)
    return {"epoch": 49, "global_step": 1000, "pytorch-lightning_version": "2.1.3", "state_dict": weights,
            "loops": {"fit_loop": {"state_dict": {}, "epoch_progress": progress}},
            "callbacks": {"ModelCheckpoint{'monitor': None}": {"best_model_path": "epoch=49.ckpt", "best_k_models": {}, "kth_value": torch.tensor(math.inf)}},
            "optimizer_states": [{"state": some, "param_groups": [group]}], "lr_schedulers": [{"base_lrs": [4e-4], "last_epoch": 1 << 40}]}


def strided(state):
    """All in one storage, some of them turned about in it."""
    parts, places, at = [], {}, 3
    for name, value in state.items():
        turned = value.dim() > 1 and len(places) % 2
        part = value.permute(*reversed(range(value.dim()))).contiguous() if turned else value
        places[name] = (at, part.shape, turned)
        parts.append(part.reshape(-1))
        at += part.numel()
    flat = torch.cat([torch.full((3,), math.nan), *parts, torch.full((5,), math.nan)])
    out = collections.OrderedDict()
    for name, (begin, shape, turned) in places.items():
        view = flat[begin:begin + math.prod(shape)].view(shape)
        out[name] = view.permute(*reversed(range(view.dim()))) if turned else view
        assert torch.equal(out[name], state[name])
    return out


def main():
    out, model, other = sys.argv[1], read(sys.argv[2]), read(sys.argv[3])
    net = collections.OrderedDict((f"net.{k}", v) for k, v in model.items())
    save = lambda name, what, **how: torch.save(what, f"{out}/{name}", **how)
    changed = lambda **values: collections.OrderedDict({**net, **{k.replace("__", "."): v for k, v in values.items()}})

    save("lightning.ckpt", lightning(net))
    save("bare.pth", model)
    save("wrapped.pth", {f"module.{k}": torch.nn.Parameter(v) for k, v in model.items()})
    save("parallel.ckpt", lightning({f"net.module.{k}": v for k, v in model.items()}))
    first = lambda k: k.split(".")[0]
    save("compiled.ckpt", lightning({"net." + k.replace(f"{first(k)}.", f"{first(k)}._orig_mod.", 1): v for k, v in model.items()}))
    save("strided.ckpt", lightning(strided(net)))
    save("other.ckpt", lightning({f"net.{k}": v for k, v in other.items()}))
    for name, dtype in (("half", torch.float16), ("bfloat", torch.bfloat16), ("double", torch.float64)):
        save(f"{name}.ckpt", lightning({k: v.to(dtype) for k, v in net.items()}))
        with open(f"{out}/{name}.raw", "wb") as f:  # the same as floats, in the model file's order
            for v in model.values():
                f.write(v.to(dtype).float().contiguous().numpy().tobytes())
    save("more.ckpt", lightning(changed(loss__lpips__weight=torch.ones(3), net__encoder__model__head__weight=torch.ones(2, 2), net__centers=torch.arange(4))))

    some = "net.dir_norm.mlp.0.weight"
    without = collections.OrderedDict((k, v) for k, v in net.items() if k != some)
    save("missing.ckpt", lightning(without))
    save("misshapen.ckpt", lightning({**net, some: net[some].t()}))
    save("whole.ckpt", lightning({**net, some: net[some].long()}))
    save("nan.ckpt", lightning({**net, some: net[some] * math.nan}))
    save("text.ckpt", lightning({**net, some: torch.zeros(2)}) | {"state_dict": {**net, some: "weights"}})
    save("repeated.ckpt", {k: torch.zeros(1).expand(v.shape) for k, v in net.items()})
    save("extra.ckpt", lightning(changed(net__predictor__third__weight=torch.ones(2))))
    save("sparse.ckpt", lightning({**net, some: net[some].to_sparse()}))
    save("complex.ckpt", lightning({**net, some: net[some].to(torch.complex64)}))
    save("lara.ckpt", lightning({"net.img_encoder.model.cls_token": torch.zeros(1, 1, 8), "net.vol_decoder.pos_embed": torch.zeros(1, 2, 2, 2, 2)}))
    save("genden.ckpt", lightning({"net.vol_decoder.pos_embed": torch.zeros(1, 2, 2, 2, 2), "net.dec.0.up.skip.weight": torch.zeros(2, 2)}))
    save("densified.ckpt", lightning(changed(**{"net.dec.0.up.skip.weight": torch.zeros(2, 2)})))
    save("share.ckpt", lightning(changed(**{"net.share.transformer.layers.0.self_attn.merge.weight": torch.zeros(2, 2)})))
    encoder = {k.removeprefix("encoder.model."): v for k, v in model.items() if k.startswith("encoder.model.")}
    save("dino.pth", encoder)
    save("dino_teacher.pth", {"student": {f"module.backbone.{k}": v for k, v in encoder.items()}, "teacher": {f"backbone.{k}": v for k, v in encoder.items()}, "epoch": 3})
    save("dinov3.pth", {**encoder, "embeddings.register_tokens": torch.zeros(1, 4, 12)})
    save("list.pth", [1, 2])
    save("empty.pth", {})
    save("old.pth", model, _use_new_zipfile_serialization=False)
    save("protocol.pth", model, pickle_protocol=4)
    save("module.pth", torch.nn.Linear(2, 2))
    torch.jit.script(torch.nn.Linear(2, 2)).save(f"{out}/script.pt")


main()
