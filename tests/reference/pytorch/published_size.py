"""A network of the published size beside the product's: random weights, saved as PyTorch saves them, imported, run on four pictures, and every
stage held against the specification in float64. What each takes, and what VS-Splat's network of the paper's size takes right after. Of VS-Splat
with the densifier nobody has published weights: the product's own random ones are read, and a tenth of the voxels is selected for both.

    VSPLAT=... python3 published_size.py --system lara|genden|vsplat+genden --work DIR [--seed 0] [--threads 2] [--block 4]

Not a test: minutes, and 8 GiB. Of LaRa's coarse drawings a block of tiles is made again (a whole one takes the specification ten minutes and more);
the specification of Gaussians visits every one of them at every pixel, which nobody waits for at this size.
Of the product's what it chose is held: which primitives are kept (looked at by itself), their scores, what the drawings showed at them."""
import argparse
import json
import os
import subprocess
import sys
import time

import torch

import genden_reference as genden
import lara_reference as lara
import make_published
import object_views
import safetensors_file
import serialisation
import splat2d_reference as splat2d
import splat3d_reference as splat3d
import vsplat_config
import vsplat_reference as ref

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "cli"))
import support  # noqa: E402: found by the line above

KEPT = 0.15     # of the primitives, as of an object in its cube
SHELL = 0.1     # of VS-Splat's voxels, nearest to a sphere


def write_views(folder, images, c2w, K):
    os.makedirs(os.path.join(folder, "images"), exist_ok=True)
    frames = []
    for i, (image, pose) in enumerate(zip(images, c2w)):
        rows = [[tuple(p) for p in row] for row in (image * 255).round().int().tolist()]
        support.write_png(os.path.join(folder, "images", f"{i}.png"), len(rows[0]), len(rows), rows)
        frames.append({"file_path": f"images/{i}.png", "transform_matrix": (pose.double() @ torch.diag(torch.tensor([1., -1, -1, 1])).double()).tolist()})
    side = images.shape[1]
    with open(os.path.join(folder, "transforms.json"), "w") as f:
        json.dump({"fl_x": K[0, 0, 0].item(), "w": side, "h": side, "aabb_center": [0, 0, 0], "aabb_half": 0.5, "frames": frames}, f)


def product(*arguments):
    """-> seconds of the whole process, seconds of processor. (What is resident at the most counts this process, which it is forked from.)"""
    begun = time.perf_counter()
    process = subprocess.Popen([support.VSPLAT, *map(str, arguments), "--overwrite", "--quiet"])
    _, status, use = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, arguments
    return time.perf_counter() - begun, use.ru_utime + use.ru_stime


def measured(name, model, views, work, *more):
    at = lambda ending: os.path.join(work, f"{name}{ending}")
    run = lambda *others: product("reconstruct", views, "--model", model, "--output", at(".ply"), *more, *others)
    run()  # compiles
    wall, processor = run("--profile", at(".json"))
    with open(at(".json")) as f:
        profile = json.load(f)
    print(f"{name}: {wall:.1f} s in all ({processor:.1f} of processor), {profile['kernels_s']:.1f} s of it on the device, "
          f"{profile['peak_bytes'] / 2**30:.2f} GiB of the device's memory", flush=True)


def settle(model, volume):
    """Primitives of useful sizes, of which KEPT are not transparent."""
    cfg, c = model.cfg, model.decoder.mlp_coarse
    with torch.no_grad():
        h = torch.relu(c[2](torch.relu(c[0](volume))))
        wide = c[4].out_features // cfg.primitives
        for k in range(cfg.primitives):
            make_published.spread(c[4], [(slice(k * wide + g.start, k * wide + g.stop), m, s)
                                         for g, m, s in make_published.primitive_groups(cfg.sh_dim, cfg.scale_dim)], h)
        raw = torch.logit(model.coarse(volume).opacities)
        shift = torch.logit(torch.tensor(cfg.opacity_threshold)) - raw.sort()[0][int((1 - KEPT) * len(raw))]
        for k in range(cfg.primitives):
            c[4].bias[k * wide + 3 + cfg.sh_dim] += shift


def timed(what, run, result):
    begun = time.perf_counter(), time.process_time()
    with torch.no_grad():
        out = run()
    result.append((what, time.perf_counter() - begun[0], time.process_time() - begun[1]))
    return out


def stages(model, given, result):
    """The specification's stages on what the product took and chose."""
    images, c2w, K, kept, samples, score, orders = given
    cfg, t = model.cfg, {}
    feats = t["features"] = timed("encoder, modulation", lambda: model.features(images, c2w, K), result)
    lifted = timed("lifting", lambda: model.lift(feats, c2w, K), result)
    volume = t["volume"] = timed("volume", lambda: model.vol_decoder(lifted, t), result)
    g = timed("heads", lambda: model.coarse(volume), result)
    t.update({f"coarse.{f}": getattr(g, f) for f in splat3d.GAUSSIAN_FIELDS})
    fine = t["fine.output"] = timed("refinement", lambda: model.decoder.fine(volume[kept // cfg.primitives], samples), result)
    sh = g.sh[kept] + fine[:, cfg.fine_features:].reshape(len(kept), -1, 3)
    final = genden.pick(g, kept)
    final.sh = sh
    if score is not None:
        feature = torch.cat([fine[:, :cfg.fine_features], volume[kept // cfg.primitives]], -1)
        t.update({f"kept.{f}": getattr(final, f) for f in splat3d.GAUSSIAN_FIELDS})
        final = timed("densifier", lambda: genden.densify(model.dec, final, score[kept], feature, None, orders, t), result)
    t.update({f"final.{f}": getattr(final, f) for f in splat3d.GAUSSIAN_FIELDS})
    return t


def vsplat_stages(model, given, result):
    """The same of VS-Splat's network with the densifier, at the voxels that were selected and by the product's scores."""
    images, c2w, K, voxels, score, orders = given
    t = {}
    timed("network and densifier", lambda: model(images, c2w, K, voxels=voxels, score=score, orders=orders, trace=t), result)
    return t


def off(got, want):
    """-> the largest error, in units of the largest of its channel, as the tests have it, and which share of the values is off by more
    than 1e-4 of that; NaN where the shapes differ"""
    if got.numel() != want.numel():
        return float("nan"), float("nan")
    want = want.double().reshape(len(want), -1)
    error = (got.double().reshape(want.shape) - want).abs() / want.abs().amax(0).clamp(min=1e-30)
    return error.max().item(), (error > 1e-4).double().mean().item()


def compare(dump, exact, single):
    worst = 0
    for name in sorted(dump):
        key = name.removeprefix("stage.")
        if not name.startswith("stage.") or key not in exact or dump[name].dtype == torch.int64:
            continue
        (ours, beyond), (theirs, _) = off(dump[name], exact[key]), off(single[key], exact[key])
        worst = max(worst, ours if ours == ours else float("inf"))
        print(f"  {key:32s} {ours:.1e}   (PyTorch in float32: {theirs:.1e})" + (f", {beyond:.1e} of the values beyond 1e-4" if beyond else ""), flush=True)
    print(f"worst {worst:.1e}", flush=True)


def compare_drawing(model, dump, kept, tiles):
    """What the drawing of the first view shows at the kept ones, those that fall into a block of tiles in its middle: the specification takes a
    second and more for each tile."""
    cfg, begun = model.cfg, time.perf_counter()
    g = splat3d.Gaussians(*[dump[f"stage.coarse.{f}"].double() for f in splat3d.GAUSSIAN_FIELDS])
    pose, k = dump["input.c2w"][0].double(), dump["input.K"][0].double()
    first = (cfg.image // splat2d.TILE - tiles) // 2
    low, high = first * splat2d.TILE, (first + tiles) * splat2d.TILE
    mirror = torch.zeros(3).double() if cfg.negate_camera_centre else None
    seen = splat2d.project(g, pose, k, cfg.image, cfg.image, cfg.revision)
    colour, opacity = splat2d.colours(g, pose, mirror)[seen.index], g.opacities[seen.index]
    maps = [torch.zeros(cfg.image, cfg.image, 3).double(), *[torch.zeros(cfg.image, cfg.image).double() for _ in range(2)]]
    for ty in range(first, first + tiles):
        for tx in range(first, first + tiles):
            here = ((seen.rect[:, 0] <= tx) & (tx < seen.rect[:, 1]) & (seen.rect[:, 2] <= ty) & (ty < seen.rect[:, 3])).nonzero()[:, 0]
            rows, columns = (slice(t * splat2d.TILE, (t + 1) * splat2d.TILE) for t in (ty, tx))
            py, px = torch.meshgrid(torch.arange(rows.start, rows.stop), torch.arange(columns.start, columns.stop), indexing="ij")
            with torch.no_grad():
                parts = splat2d.shade((px + 0.5).double().reshape(-1), (py + 0.5).double().reshape(-1), seen.T[here], seen.centre[here], seen.normal[here],
                                      colour[here], opacity[here], cfg.revision)
            for whole, part in zip(maps, parts):
                whole[rows, columns] = part.reshape(splat2d.TILE, splat2d.TILE, *whole.shape[2:])
    image, alpha, depth = maps
    depth = torch.where(alpha > 0, depth / alpha.clamp(min=1e-300), depth)
    drawing = {"image": (image + 1 - alpha[..., None]).clamp(0, 1)[None], "alpha": alpha[None], "depth": depth[None]}
    xy, _ = ref.project(g.means[kept], torch.inverse(pose)[None], k[None])
    inside = ((xy[0] > low + 2) & (xy[0] < high - 2)).all(-1)
    want = model.samples(g.means[kept][inside], dump["input.images"][:1].double(), drawing, pose[None], k[None])[:, 0]
    error = ((dump["stage.fine.samples"][inside, 0].double() - want).abs() / want.abs().amax(0).clamp(min=1)).flatten().sort()[0]
    print(f"drawing, {tiles} x {tiles} tiles in the middle of a view, at {len(want)} primitives: 99.9 % within {error[int(0.999 * (len(error) - 1))].item():.1e}, "
          f"mean {error.mean().item():.1e}; {time.perf_counter() - begun:.0f} s in PyTorch", flush=True)


def hold(model, given, dump, stages):
    """Every stage that was dumped against the specification's in float64, which is returned, and beside its own in float32."""
    result = []
    with torch.no_grad():
        single = stages(model.float(), given, result)
        print("PyTorch in float32: " + ", ".join(f"{what} {s:.1f} s" for what, s, _ in result)
              + f"; {sum(s for _, s, _ in result):.1f} s ({sum(p for _, _, p in result):.1f} of processor), drawings aside", flush=True)
        to_double = lambda x: x.double() if torch.is_tensor(x) and x.is_floating_point() else x
        exact = stages(model.double(), tuple(map(to_double, given)), [])
    compare(dump, exact, single)
    return exact


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--system", required=True, choices=("lara", "genden", "vsplat+genden"))
    parser.add_argument("--work", required=True)
    parser.add_argument("--size", default="published", help="of the specification's configurations")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--block", type=int, default=4, help="tiles along an edge of what is drawn again")
    a = parser.parse_args()
    torch.set_num_threads(a.threads)
    at = lambda *parts: os.path.join(a.work, *parts)
    os.makedirs(a.work, exist_ok=True)

    torch.manual_seed(a.seed)
    model, _ = genden.build(a.system, a.size)
    cfg = model.cfg
    c2w, K = object_views.orbit_cameras(cfg.views, cfg, seed=a.seed)
    images = (object_views.checked_ball(c2w, K, cfg.image) * 255).round() / 255
    write_views(at("views"), images, c2w, K)
    with open(at("shell.txt"), "w") as f:
        paper = vsplat_config.CONFIGS["paper"]
        r = ref.voxel_centres(paper.volume, torch.zeros(1)).norm(dim=1)
        shell = (r - 0.3).abs().argsort(stable=True)[:int(SHELL * paper.volume ** 3)].sort()[0]
        f.writelines(f"{int(i)}\n" for i in shell)
    alone = a.system == "vsplat+genden"
    if alone:
        product("init", "paper", "--system", a.system, "--seed", a.seed, "--output", at("model.safetensors"))
        model.load(safetensors_file.load_safetensors(at("model.safetensors"))[0])
        print(f"{a.system}: {lara.count(model):,} parameters", flush=True)
    else:
        make_published.randomise(model, a.seed)
        with torch.no_grad():
            settle(model, model.vol_decoder(model.lift(model.features(images, c2w, K), c2w, K)))
        make_published.checkpoint(at("model.ckpt"), {k: v.detach() for k, v in model.state_dict().items()}, dict(model.named_parameters()))
        print(f"{a.system}: {lara.count(model):,} parameters, {os.path.getsize(at('model.ckpt')) / 2**20:.0f} MiB as .ckpt", flush=True)
        imported, _ = product("weights", "import", at("model.ckpt"), "--output", at("model.safetensors"))
        print(f"imported in {imported:.1f} s", flush=True)
    selection = ("--selection", at("shell.txt"))
    measured(a.system, at("model.safetensors"), at("views"), a.work, *(selection if alone else ("--assume-selected", 0.5)))
    product("reconstruct", at("views"), "--model", at("model.safetensors"), "--output", at("o.ply"), "--dump", at("dump"),
            *(("--selection-seed", a.seed) if a.system == "genden" else selection if alone else ()))
    dump, _ = safetensors_file.load_safetensors(at("dump", "stages.safetensors"))
    product("init", "paper", "--seed", a.seed, "--output", at("paper.safetensors"))
    measured("vsplat", at("paper.safetensors"), at("views"), a.work, *selection)

    if alone:
        # Without a seed its curves are in the order of seed 0, and the selection has no noise.
        given = (dump["input.images"], dump["input.c2w"], dump["input.K"], shell, dump["stage.score"], serialisation.random_perms(0))
        print(f"{len(dump['stage.base.means'])} primitives of {len(shell)} voxels, {len(dump['stage.final.means'])} in the end", flush=True)
        hold(model, given, dump, vsplat_stages)
        return
    kept = (dump["stage.coarse.opacities"] > cfg.opacity_threshold).nonzero()[:, 0]
    print(f"{len(kept)} of {len(dump['stage.coarse.opacities'])} primitives kept, {len(dump['stage.final.means'])} in the end", flush=True)
    given = (dump["input.images"], dump["input.c2w"], dump["input.K"], kept, dump["stage.fine.samples"], dump.get("stage.score"),
             serialisation.random_perms(a.seed) if a.system == "genden" else None)
    result = []
    single = stages(model.float(), given, result)
    print("PyTorch in float32: " + ", ".join(f"{what} {s:.1f} s" for what, s, _ in result)
          + f"; {sum(s for _, s, _ in result):.1f} s ({sum(s for _, _, s in result):.1f} of processor), drawings aside", flush=True)
    to_double = lambda x: x.double() if torch.is_tensor(x) and x.is_floating_point() else x
    exact = stages(model.double(), tuple(map(to_double, given)), [])
    compare(dump, exact, single)
    raw = torch.logit(exact["coarse.opacities"]) - torch.logit(torch.tensor(cfg.opacity_threshold).double())
    other = (raw > 0).nonzero()[:, 0]
    differ = set(other.tolist()) ^ set(kept.tolist())
    far = max((raw[i].abs().item() for i in differ), default=0.0)
    print(f"{len(differ)} of the primitives are kept by one alone, at most {far:.1e} (logit) from the threshold", flush=True)

    if cfg.kind == "surfel":
        compare_drawing(model, dump, kept, a.block)


if __name__ == "__main__":
    main()
