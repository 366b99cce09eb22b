#include "model/lift.h"

#include <algorithm>

#include "model/ops/lift.h"

namespace vsplat {
namespace {

// Voxels whose variance is in memory at a time: 24 MiB at C = 768.
constexpr long kBlock = 8192;

}  // namespace

Lifting::Lifting(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "volume_network.conv_in.0.");
  const long c = config.vit_dim, wide = 4L * config.volume_ch;
  mean_ = load.linear_part("weight", {wide, 2 * c, 1, 1, 1}, 0, c);
  variance_ = load.linear_part("weight", {wide, 2 * c, 1, 1, 1}, c, c);
  bias_ = load.tensor("bias", {wide});
}

Tensor Lifting::forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras) const {
  const Stage stage(ctx, "lifting");
  const long v = features.dim(0), t = config_.tokens(), c = config_.vit_dim, wide = mean_.n, voxels = config_.voxels();
  const Tensor maps = features.reshaped({v * t * t, c});
  const Tensor projected = ctx.tensor({v * t * t, wide}, Type::f32, "lifting.projected");
  Gemm project;
  project.a.x0 = maps;
  project.b = &mean_;
  project.out = projected;
  project.name = "lift.project";
  gemm(ctx, project);

  const Tensor out = ctx.tensor({voxels, wide}, Type::f32, "lifting.out");
  const long block = std::min(kBlock, voxels);
  const Tensor all_index = ctx.tensor({block, v, 4}, Type::i32, "lifting.index");
  const Tensor all_weight = ctx.tensor({block, v, 4}, Type::f32, "lifting.weight");
  const Tensor all_variance = ctx.tensor({block, c}, Type::f32, "lifting.variance");
  for (long first = 0; first < voxels; first += block) {
    const long n = std::min(block, voxels - first);
    const Tensor index = all_index.first(n), weight = all_weight.first(n), variance = all_variance.first(n);
    lift_corners(ctx, {cameras, config_.volume, config_.tokens(), config_.image, config_.sample_half_pixel, first,
                       index, weight});
    lift_variance_forward(ctx, {maps, index, weight, variance});
    lift_mean_forward(ctx, {projected, index, weight, bias_, first, out});
    Gemm add;
    add.a.x0 = variance;
    add.b = &variance_;
    add.residual = out;
    add.out = out;
    add.row0 = 0;
    add.rows = n;
    add.out_row0 = first;
    add.name = "lift.variance";
    gemm(ctx, add);
  }
  return out;
}

}  // namespace vsplat
