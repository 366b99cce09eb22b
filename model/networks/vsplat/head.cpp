#include "model/networks/vsplat/head.h"

#include "model/ops/networks/decode.h"
#include "runtime/shape_check.h"

namespace vsplat {

CoarseHeads::CoarseHeads(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

CoarseHeads::Output CoarseHeads::forward(Context& ctx, const Tensor& volume, Saved* saved) const {
  const long voxels = config_.voxels();
  Dims().set("R^3", voxels).set("C", config_.volume_ch).bind("volume", volume, {"R^3", "C"});
  Output out;
  Tensor raw;
  {
    const Stage stage(ctx, "heads");
    out.logits =
        mlp3_forward(ctx, layers_.act_predictor, volume, "act_predictor", saved ? &saved->act_predictor : nullptr)
            .reshaped({voxels});
    raw = mlp3_forward(ctx, layers_.coarse_predictor, volume, "coarse_predictor",
                       saved ? &saved->coarse_predictor : nullptr);
  }
  if (saved) saved->raw = raw;
  const Stage stage(ctx, "decode");
  out.gaussians = make_gaussians(ctx, voxels, config_.sh_count(), "coarse");
  decode_coarse_forward(ctx, {raw, config_.volume, out.gaussians});
  return out;
}

void CoarseHeads::backward(Context& ctx, const Saved& saved, const Tensor& dlogits, const GaussianGradients& dgaussians,
                           const Tensor& dvolume, bool add) const {
  const Stage stage(ctx, "heads");
  const Tensor draw = ctx.tensor(saved.raw.shape(), Type::f32, "coarse_predictor gradient");
  {
    const Stage decode(ctx, "decode");
    decode_coarse_backward(ctx, {saved.raw, config_.volume, dgaussians, draw});
  }
  mlp3_backward(ctx, layers_.coarse_predictor, saved.coarse_predictor, draw, dvolume, add, "coarse_predictor");
  if (!dlogits) return;
  mlp3_backward(ctx, layers_.act_predictor, saved.act_predictor, dlogits.reshaped({config_.voxels(), 1}), dvolume, true,
                "act_predictor");
}

FineHeads::FineHeads(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config), places_(layers_of(ctx, weights), config) {}

DeviceGaussians FineHeads::forward(Context& ctx, const Tensor& refined, const DeviceGaussians& skeleton,
                                   Saved* saved) const {
  const long p = skeleton.count(), m = config_.fine_count;
  Dims().set("P", p).set("C", config_.fine_dim).bind("refined", refined, {"P", "C"});
  Tensor raw, update;
  {
    const Stage stage(ctx, "heads");
    raw =
        mlp3_forward(ctx, layers_.fine_predictor, refined, "fine_predictor", saved ? &saved->fine_predictor : nullptr);
    update = mlp3_forward(ctx, layers_.update_predictor, refined, "update_predictor",
                          saved ? &saved->update_predictor : nullptr);
  }
  if (saved) saved->raw = raw, saved->update = update, saved->opacities = skeleton.opacities;
  const Stage stage(ctx, "decode");
  DeviceGaussians out = make_gaussians(ctx, m * p + p, config_.sh_count(), "final");
  decode_fine_forward(ctx, {raw, skeleton.means, places_.div_offset, config_.volume, out});
  decode_adjusted_forward(ctx, {update, skeleton, m * p, out});
  return out;
}

void FineHeads::backward(Context& ctx, const Saved& saved, const GaussianGradients& dfinal, const Tensor& drefined,
                         const GaussianGradients& dskeleton) const {
  const Tensor draw = ctx.tensor(saved.raw.shape(), Type::f32, "fine_predictor gradient");
  const Tensor dupdate = ctx.tensor(saved.update.shape(), Type::f32, "update_predictor gradient");
  {
    const Stage stage(ctx, "decode");
    const long fine = saved.raw.dim(0) * config_.fine_count;
    decode_fine_backward(ctx, {saved.raw, config_.volume, dfinal, draw, dskeleton.means});
    decode_adjusted_backward(ctx, {saved.update, saved.opacities, fine, dfinal, dupdate, dskeleton});
  }
  const Stage stage(ctx, "heads");
  mlp3_backward(ctx, layers_.fine_predictor, saved.fine_predictor, draw, drefined, false, "fine_predictor");
  mlp3_backward(ctx, layers_.update_predictor, saved.update_predictor, dupdate, drefined, true, "update_predictor");
}

}  // namespace vsplat
