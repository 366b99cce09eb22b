#include "model/head.h"

#include "model/ops/decode.h"
#include "runtime/shape_check.h"

namespace vsplat {

CoarseHeads::CoarseHeads(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "predictor.");
  act_predictor_ = load_mlp3(load, "act_predictor", config.volume_ch, 1);
  coarse_predictor_ = load_mlp3(load, "coarse_predictor", config.volume_ch, config.primitive_size());
}

CoarseHeads::Output CoarseHeads::forward(Context& ctx, const Tensor& volume) const {
  const long voxels = config_.voxels();
  Dims().set("R^3", voxels).set("C", config_.volume_ch).bind("volume", volume, {"R^3", "C"});
  Output out;
  Tensor raw;
  {
    const Stage stage(ctx, "heads");
    out.logits = mlp3(ctx, act_predictor_, volume, "act_predictor").reshaped({voxels});
    raw = mlp3(ctx, coarse_predictor_, volume, "coarse_predictor");
  }
  const Stage stage(ctx, "decode");
  out.gaussians = make_gaussians(ctx, voxels, config_.sh_count(), "coarse");
  decode_coarse_forward(ctx, {raw, config_.volume, out.gaussians});
  return out;
}

FineHeads::FineHeads(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "predictor.");
  fine_predictor_ = load_mlp3(load, "fine_predictor", config.fine_dim, config.fine_count * config.primitive_size());
  update_predictor_ = load_mlp3(load, "update_predictor", config.fine_dim, 1 + 3 * config.sh_count());
  div_offset_ = WeightLoader(ctx, weights, "").tensor("div_offset", {config.fine_count, 3});
}

DeviceGaussians FineHeads::forward(Context& ctx, const Tensor& refined, const DeviceGaussians& skeleton) const {
  const long p = skeleton.count(), m = config_.fine_count;
  Dims().set("P", p).set("C", config_.fine_dim).bind("refined", refined, {"P", "C"});
  Tensor raw, update;
  {
    const Stage stage(ctx, "heads");
    raw = mlp3(ctx, fine_predictor_, refined, "fine_predictor");
    update = mlp3(ctx, update_predictor_, refined, "update_predictor");
  }
  const Stage stage(ctx, "decode");
  DeviceGaussians out = make_gaussians(ctx, m * p + p, config_.sh_count(), "final");
  decode_fine_forward(ctx, {raw, skeleton.means, div_offset_, config_.volume, out});
  decode_adjusted_forward(ctx, {update, skeleton, m * p, out});
  return out;
}

}  // namespace vsplat
