#include "model/networks/vsplat/fused_lift.h"

#include <algorithm>

#include "model/ops/dense/add_columns.h"
#include "model/ops/networks/lift.h"
#include "runtime/blocks.h"
#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Voxels whose variance is in memory at a time: 24 MiB at C = 768.
constexpr long kBlock = 8192;
// Maximum size, in floats, of the backward's largest scratch tensor: the gradients by all samples of a block of voxels.
constexpr long kBackwardFloats = 8 << 20;

Tensor zeros(Context& ctx, const Shape& shape, const char* what) {
  const Tensor out = ctx.tensor(shape, Type::f32, what);
  ctx.fill_zero(out);
  return out;
}

}  // namespace

Lifting::Lifting(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

Tensor Lifting::forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras, Saved* saved) const {
  const Stage stage(ctx, "lifting");
  if (saved) *saved = {features, cameras};
  const SplitLinear& conv = layers_.mean_and_variance;
  const long v = features.dim(0), t = config_.tokens(), c = config_.vit_dim, wide = 4L * config_.volume_ch;
  const long voxels = config_.voxels();
  const Tensor maps = features.reshaped({v * t * t, c});
  const Tensor projected = ctx.tensor({v * t * t, wide}, Type::f32, "lifting.projected");
  Gemm project;
  project.a.x0 = maps;
  project.b = &conv.first;
  project.out = projected;
  project.name = "lift.project";
  gemm(ctx, project);

  const Tensor out = ctx.tensor({voxels, wide}, Type::f32, "lifting.out");
  const long block = std::min(kBlock, voxels);
  const Tensor all_index = ctx.tensor({block, v, 4}, Type::i32, "lifting.index");
  const Tensor all_weight = ctx.tensor({block, v, 4}, Type::f32, "lifting.weight");
  const Tensor all_variance = ctx.tensor({block, c}, Type::f32, "lifting.variance");
  for (const long first : block_starts(ctx, voxels, block)) {
    const long n = std::min(block, voxels - first);
    const Tensor index = all_index.first(n), weight = all_weight.first(n), variance = all_variance.first(n);
    lift_corners(ctx, {cameras, config_.volume, config_.tokens(), config_.image, config_.sample_half_pixel, first,
                       index, weight});
    lift_variance_forward(ctx, {maps, index, weight, variance});
    lift_mean_forward(ctx, {projected, index, weight, conv.bias, first, out});
    Gemm add;
    add.a.x0 = variance;
    add.b = &conv.rest;
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

void Lifting::backward(Context& ctx, const Saved& saved, const Tensor& dout, const Tensor& dfeatures) const {
  const Stage stage(ctx, "lifting");
  const SplitLinear& conv = layers_.mean_and_variance;
  const long v = saved.features.dim(0), t = config_.tokens(), c = config_.vit_dim, wide = 4L * config_.volume_ch;
  const long voxels = config_.voxels(), texels = v * t * t;
  Dims().set("R^3", voxels).set("W", wide).bind("dout", dout, {"R^3", "W"});
  const Tensor maps = saved.features.reshaped({texels, c}), dmaps = dfeatures.reshaped({texels, c});
  const Tensor dprojected = zeros(ctx, {texels, wide}, "lifting.dprojected");
  column_sum(ctx, {dout, conv.dbias, true});
  {
    const Tensor dweight = zeros(ctx, {wide, c}, "lifting.dweight");
    const PackedMatrix back = pack_matrix(ctx, conv.plain, wide, c, 2 * c, 1, "lifting.variance_back", c);
    const long block = std::min(std::clamp(kBackwardFloats / (v * c), 64L, kBlock), voxels);
    const Tensor all_index = ctx.tensor({block, v, 4}, Type::i32, "lifting.index");
    const Tensor all_weight = ctx.tensor({block, v, 4}, Type::f32, "lifting.weight");
    const Tensor all_variance = ctx.tensor({block, c}, Type::f32, "lifting.variance");
    const Tensor all_dout = ctx.tensor({block, wide}, Type::f32, "lifting.dout");
    for (const long first : block_starts(ctx, voxels, block)) {
      const long n = std::min(block, voxels - first);
      const Tensor index = all_index.first(n), weight = all_weight.first(n), variance = all_variance.first(n);
      lift_corners(ctx, {saved.cameras, config_.volume, config_.tokens(), config_.image, config_.sample_half_pixel,
                         first, index, weight});
      const ScatterPlan plan = make_scatter_plan(ctx, index, weight, texels);
      lift_mean_backward(ctx, {v, &plan, dout, first, dprojected});
      lift_variance_forward(ctx, {maps, index, weight, variance});
      Gemm g;
      g.a.x0 = dout;
      compose_rows(ctx, g.a, all_dout.first(n), first);
      transposed_gemm(ctx, {all_dout.first(n), variance, dweight, true, "lift.variance.dw"});
      g.b = &back;
      g.out = variance;  // now the gradient by it
      g.row0 = first;
      g.rows = n;
      g.out_row0 = 0;
      g.name = "lift.variance.dx";
      gemm(ctx, g);
      lift_variance_backward(ctx, {maps, index, weight, &plan, variance, dmaps});
    }
    add_columns(ctx, {dweight, conv.dweight, c});
  }
  const Tensor dweight = ctx.tensor({wide, c}, Type::f32, "lifting.dweight");
  transposed_gemm(ctx, {dprojected, maps, dweight, false, "lift.project.dw"});
  add_columns(ctx, {dweight, conv.dweight, 0});
  const PackedMatrix back = pack_matrix(ctx, conv.plain, wide, c, 2 * c, 1, "lifting.mean_back");
  Gemm g;
  g.a.x0 = dprojected;
  g.b = &back;
  g.residual = g.out = dmaps;
  g.name = "lift.project.dx";
  gemm(ctx, g);
}

}  // namespace vsplat
