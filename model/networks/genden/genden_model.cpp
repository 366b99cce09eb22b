#include "model/networks/genden/genden_model.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "model/networks/genden/score.h"
#include "model/networks/layers/running.h"
#include "model/ops/dense/gather.h"
#include "runtime/fail.h"
#include "runtime/units.h"

namespace vsplat {

GendenModel::GendenModel(Context& ctx, const GendenConfig& config, const WeightSource& weights)
    : config_(config), backbone_(ctx, config, weights) {
  densifier_ = load_densifier(ctx, config.densify, config.sh_count(), weights);
}

Tensor GendenModel::score(Context& ctx, const LaraResult& base, const Tensor& images,
                          const std::vector<Camera>& cameras, const GendenOptions& options) const {
  if (options.score) return *options.score;
  return screen_scores(ctx, base.coarse, images, cameras, config_.densify, config_.negate_camera_centre,
                       options.backbone.tap);
}

DeviceGaussians GendenModel::densify(Context& ctx, const LaraResult& base, const Tensor& score,
                                     const GendenOptions& options, std::shared_ptr<Densifier::Saved>* saved) const {
  const long p = base.final.count(), f = config_.fine_features, c = config_.out_ch;
  Densifier::Input in;
  in.candidates = base.final;
  in.score = ctx.tensor({p}, Type::f32, "densify.score");
  gather_forward(ctx, {score.reshaped({score.dim(0), 1}), base.index, in.score.reshaped({p, 1})});
  // The fine decoder's features, then the voxel's.
  in.features = [&](Context& on, const Tensor& selected) {
    const long k = selected.dim(0);
    const Tensor out = on.tensor({k, f + c}, Type::f32, "densify.feature");
    const Tensor voxels = on.tensor({p, c}, Type::f32, "densify.voxels");
    gather_forward(on, {base.volume, base.index, voxels, 0, config_.primitives});
    if (f > 0) gather_forward(on, {base.features, selected, out});
    gather_forward(on, {voxels, selected, out, f});
    return out;
  };
  in.orders = options.orders.empty() ? random_orders(config_.densify, options.seed) : options.orders;
  return densifier_->forward(ctx, in, saved, ctx.planning() ? DensifyTap() : options.backbone.tap);
}

GendenResult GendenModel::forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                  const GendenOptions& options) const {
  LaraOptions backbone = options.backbone;
  const auto tap = options.backbone.tap;
  if (tap)
    backbone.tap = [&](const std::string& name, const Tensor& t) {
      tap(name.starts_with("final.") ? "kept." + name.substr(6) : name, t);
    };
  const LaraResult base = backbone_.forward(ctx, images, cameras, backbone);
  const Tensor scores = score(ctx, base, images, cameras, options);
  const DeviceGaussians final = made_to_measure(ctx, fmt::format("the densifier at {} candidates", base.final.count()),
                                                [&](Context& c) { return densify(c, base, scores, options, nullptr); });
  GendenResult out{base.coarse, final, base.kept};
  if (tap) tap_fields(tap, "final", out.final);
  ctx.finish();
  return out;
}

MemoryPlan GendenModel::plan(const Context& ctx, long views, long kept) const {
  MemoryPlan out = backbone_.plan(ctx, views, kept);
  const auto planner = ctx.planner();
  const long n = config_.most_primitives(), p = out.selected, s = config_.sh_count();
  const auto rows = [&](const Shape& shape) { return planner->tensor(shape); };
  const auto gaussians = [&](long count) {
    return DeviceGaussians{rows({count, 3}), rows({count, 3}), rows({count, 4}), rows({count}), rows({count, s, 3})};
  };
  LaraResult base{gaussians(n), gaussians(p), {}, {}, planner->tensor({p}, Type::i32), rows({n, config_.out_ch})};
  if (config_.fine_features > 0) base.features = rows({p, config_.fine_features});
  densify(*planner, base, rows({n}), {}, nullptr);
  out.peak = std::max(out.peak, planner->memory().peak());
  for (const StageMemory& stage : planner->stage_memory())
    if (!stage.stage.empty()) out.stages.push_back(stage);
  return out;
}

MemoryPlan GendenModel::plan(const Context& ctx, const GendenConfig& config, const Weights& weights, long views,
                             long kept) {
  const auto planner = ctx.planner();
  const GendenModel model(*planner, config, weights);
  return model.plan(*planner, views, kept);
}

GendenModel::Trained GendenModel::forward_in_training(Context& ctx, const Tensor& images,
                                                      const std::vector<Camera>& cameras, const GendenOptions& options,
                                                      bool recompute) const {
  return fine_in_training(ctx, coarse_in_training(ctx, images, cameras, options, recompute), images, cameras, options);
}

LaraModel::CoarseHalf GendenModel::coarse_in_training(Context& ctx, const Tensor& images,
                                                      const std::vector<Camera>& cameras, const GendenOptions& options,
                                                      bool recompute) const {
  return backbone_.coarse_in_training(ctx, images, cameras, options.backbone, recompute);
}

GendenModel::Trained GendenModel::fine_in_training(Context& ctx, LaraModel::CoarseHalf half, const Tensor& images,
                                                   const std::vector<Camera>& cameras,
                                                   const GendenOptions& options) const {
  Trained out;
  out.backbone = backbone_.fine_in_training(ctx, std::move(half), options.backbone);
  const LaraResult& base = out.backbone.result;
  const DeviceGaussians final = densify(ctx, base, score(ctx, base, images, cameras, options), options, &out.saved);
  out.result = {base.coarse, final, base.kept};
  return out;
}

void GendenModel::backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                           const GaussianGradients& dfinal) const {
  if (!dfinal.sh) return backbone_.backward(ctx, trained.backbone, dcoarse, dfinal);
  const Densifier::Gradients d = densifier_->backward(ctx, *trained.saved, dfinal);
  LaraFeatureGradients by;
  if (d.features) {
    const long p = d.candidates.means.dim(0), f = config_.fine_features, c = config_.out_ch;
    by.voxels = ctx.tensor({p, c}, Type::f32, "gradient by voxels");
    ctx.fill_zero(by.voxels);
    gather_backward(ctx, {d.features, d.selected, by.voxels, f});
    if (f > 0) {
      by.features = ctx.tensor({p, f}, Type::f32, "gradient by features");
      ctx.fill_zero(by.features);
      gather_backward(ctx, {d.features, d.selected, by.features});
    }
  }
  backbone_.backward(ctx, trained.backbone, dcoarse, d.candidates, by);
}

}  // namespace vsplat
