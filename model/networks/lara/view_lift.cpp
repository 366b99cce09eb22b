#include "model/networks/lara/view_lift.h"

#include "model/ops/dense/gather.h"
#include "model/ops/networks/lift.h"
#include "runtime/column_sum.h"
#include "runtime/fail.h"

namespace vsplat {

LaraLifting::LaraLifting(Context& ctx, const LaraConfig& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

LaraLifting::Corners LaraLifting::corners(Context& ctx, const DeviceCameras& cameras) const {
  const long n = config_.lifted_voxels(), v = cameras.count();
  const Corners out{ctx.tensor({n, v, 4}, Type::i32, "lifting.index"),
                    ctx.tensor({n, v, 4}, Type::f32, "lifting.weight")};
  lift_corners(ctx, {cameras, config_.feature_volume, config_.tokens(), config_.image, config_.sample_half_pixel, 0,
                     out.index, out.weight});
  return out;
}

RowSource LaraLifting::forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras, Saved* saved) const {
  const Stage stage(ctx, "lifting");
  const long v = features.dim(0), t = config_.tokens(), c = config_.vit_dim, n = config_.lifted_voxels();
  if (v > config_.view_slots)
    fail(Status::usage, "{} views given, and the network has embeddings for view_slots = {}", v, config_.view_slots);
  if (saved) *saved = {cameras, features.shape()};
  const Corners at = corners(ctx, cameras);
  RowSource out;
  const Tensor samples = ctx.tensor({n, v, c}, Type::f32, "lifting.samples");
  lift_samples_forward(ctx, {features.reshaped({v * t * t, c}), at.index, at.weight, samples});
  out.x0 = samples.reshaped({n * v, c});
  std::vector<int> view_of_row(static_cast<std::size_t>(n * v));
  for (std::size_t i = 0; i < view_of_row.size(); ++i)
    view_of_row[i] = static_cast<int>(i % static_cast<std::size_t>(v));
  out.x1 = ctx.tensor({n * v, config_.view_ch}, Type::f32, "lifting.embedded");
  const Tensor index = ctx.upload({n * v}, view_of_row, Type::i32, "lifting.view");
  gather_forward(ctx, {layers_.embedding.value.reshaped({config_.view_slots, config_.view_ch}), index, out.x1});
  return out;
}

Tensor LaraLifting::backward(Context& ctx, const Saved& saved, const Tensor& dsamples, const Tensor& dembedded) const {
  const Stage stage(ctx, "lifting");
  const long v = saved.features.at(0), c = config_.vit_dim, n = config_.lifted_voxels(), e = config_.view_ch;
  const long texels = v * saved.features.at(1) * saved.features.at(2);
  // Puts a voxel's V rows side by side, so that a sum over rows gives each view's sum: the gradient of the first V
  // embeddings.
  column_sum(ctx, {dembedded.reshaped({n, v * e}),
                   layers_.embedding.gradient.reshaped({config_.view_slots * e}).first(v * e), true});
  const Corners at = corners(ctx, saved.cameras);
  const Tensor dfeatures = ctx.tensor(saved.features, Type::f32, "lifting.gradient");
  ctx.fill_zero(dfeatures);
  const ScatterPlan plan = make_scatter_plan(ctx, at.index, at.weight, texels);
  lift_samples_backward(ctx, {&plan, dsamples.reshaped({n, v, c}), dfeatures.reshaped({texels, c})});
  return dfeatures;
}

}  // namespace vsplat
