#include "model/networks/genden/vsplat_genden_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "model/networks/genden/score.h"
#include "model/networks/layers/running.h"
#include "model/ops/dense/gather.h"
#include "model/ops/dense/scatter_rows.h"
#include "model/ops/volume/compact.h"
#include "model/ops/volume/select.h"

namespace vsplat {

// What the backward needs from the densifier's half.
struct VsplatGendenModel::Dense {
  std::shared_ptr<Densifier::Saved> saved;
  Tensor index;   // i32 [Q]: indices of the candidates among the final Gaussians
  Tensor rows;    // i32 [k]: for each replaced Gaussian, its voxel's row in the refined features
  long base = 0;  // N
};

VsplatGendenModel::VsplatGendenModel(Context& ctx, const VsplatGendenConfig& config, const WeightSource& weights)
    : config_(config), backbone_(ctx, config, weights) {
  densifier_ = load_densifier(ctx, config.densify, config.sh_count(), weights);
}

Tensor VsplatGendenModel::score(Context& ctx, const DeviceGaussians& base, const Tensor& images,
                                const std::vector<Camera>& cameras, const VsplatGendenOptions& options) const {
  if (options.score) return *options.score;
  return screen_scores(ctx, base, images, cameras, config_.densify, config_.negate_camera_centre, options.backbone.tap);
}

DeviceGaussians VsplatGendenModel::densify(Context& ctx, const DeviceGaussians& base, const Tensor& refined,
                                           const Tensor& score, const VsplatGendenOptions& options, Dense* keep) const {
  const long n = base.count(), p = refined.dim(0), m = config_.fine_count;
  Densifier::Input in;
  Tensor index;
  {
    const Stage stage(ctx, "densify");
    SelectForward kept;
    kept.opacities = base.opacities;
    kept.selection = Selection::opacity;
    kept.opacity_threshold = static_cast<float>(config_.densify.opacity_threshold);
    kept.flags = ctx.tensor({n}, Type::u32, "densify.flags");
    select_forward(ctx, kept);
    index = compact(ctx, kept.flags, n);
    in.candidates = gather_forward(ctx, base, index);
    in.score = ctx.tensor({index.dim(0)}, Type::f32, "densify.score");
    gather_forward(ctx, {score.reshaped({n, 1}), index, in.score.reshaped({index.dim(0), 1})});
  }
  // M fine Gaussians per voxel, then one skeletal Gaussian per voxel.
  std::vector<int> voxels(static_cast<std::size_t>(n));
  for (long i = 0; i < n; ++i) voxels[static_cast<std::size_t>(i)] = static_cast<int>(i < m * p ? i / m : i - m * p);
  const Tensor voxel = ctx.upload({n}, voxels, Type::i32, "densify.voxels");
  in.features = [&](Context& on, const Tensor& selected) {
    const Tensor rows = gather_integers(on, gather_integers(on, voxel, index), selected);
    if (keep) keep->rows = rows;
    const Tensor out = on.tensor({selected.dim(0), refined.dim(1)}, Type::f32, "densify.feature");
    gather_forward(on, {refined, rows, out});
    return out;
  };
  in.orders = options.orders.empty() ? random_orders(config_.densify, options.seed) : options.orders;
  if (keep) keep->index = index, keep->base = n;
  return densifier_->forward(ctx, in, keep ? &keep->saved : nullptr,
                             ctx.planning() ? DensifyTap() : options.backbone.tap);
}

VsplatGendenResult VsplatGendenModel::forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                              const VsplatGendenOptions& options) const {
  ForwardOptions backbone = options.backbone;
  const auto tap = options.backbone.tap;
  if (tap)
    backbone.tap = [&](const std::string& name, const Tensor& t) {
      tap(name.starts_with("final.") ? "base." + name.substr(6) : name, t);
    };
  const ForwardResult base = backbone_.forward(ctx, images, upload_cameras(ctx, cameras), backbone);
  const Tensor scores = score(ctx, base.final, images, cameras, options);
  const DeviceGaussians final =
      made_to_measure(ctx, fmt::format("the densifier at {} Gaussians", base.final.count()),
                      [&](Context& c) { return densify(c, base.final, base.refined, scores, options, nullptr); });
  VsplatGendenResult out{base.coarse, base.final, final, base.selected, base.rays};
  if (tap) tap_fields(tap, "final", out.final);
  ctx.finish();
  return out;
}

MemoryPlan VsplatGendenModel::plan(const Context& ctx, long views, long selected) const {
  MemoryPlan out = backbone_.plan(ctx, views, selected);
  const auto planner = ctx.planner();
  const long p = out.selected, n = p * (config_.fine_count + 1), s = config_.sh_count();
  const auto rows = [&](const Shape& shape) { return planner->tensor(shape); };
  const DeviceGaussians base{rows({n, 3}), rows({n, 3}), rows({n, 4}), rows({n}), rows({n, s, 3})};
  densify(*planner, base, rows({p, config_.fine_dim}), rows({n}), {}, nullptr);
  out.peak = std::max(out.peak, planner->memory().peak());
  for (const StageMemory& stage : planner->stage_memory())
    if (!stage.stage.empty()) out.stages.push_back(stage);
  return out;
}

MemoryPlan VsplatGendenModel::plan(const Context& ctx, const VsplatGendenConfig& config, const Weights& weights,
                                   long views, long selected) {
  const auto planner = ctx.planner();
  const VsplatGendenModel model(*planner, config, weights);
  return model.plan(*planner, views, selected);
}

VsplatGendenModel::Trained VsplatGendenModel::forward_in_training(Context& ctx, const Tensor& images,
                                                                  const std::vector<Camera>& cameras,
                                                                  const VsplatGendenOptions& options,
                                                                  bool recompute) const {
  return fine_in_training(ctx, coarse_in_training(ctx, images, cameras, options, recompute), images, cameras, options);
}

VsplatModel::CoarseHalf VsplatGendenModel::coarse_in_training(Context& ctx, const Tensor& images,
                                                              const std::vector<Camera>& cameras,
                                                              const VsplatGendenOptions& options,
                                                              bool recompute) const {
  return backbone_.coarse_in_training(ctx, images, upload_cameras(ctx, cameras), options.backbone, recompute);
}

VsplatGendenModel::Trained VsplatGendenModel::fine_in_training(Context& ctx, VsplatModel::CoarseHalf half,
                                                               const Tensor& images, const std::vector<Camera>& cameras,
                                                               const VsplatGendenOptions& options) const {
  Trained out;
  out.backbone = backbone_.fine_in_training(ctx, std::move(half), options.backbone);
  const DeviceGaussians& base = out.backbone.final;
  out.dense = std::make_shared<Dense>();
  out.final =
      densify(ctx, base, out.backbone.refined, score(ctx, base, images, cameras, options), options, out.dense.get());
  return out;
}

void VsplatGendenModel::backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                                 const GaussianGradients& dfinal, const Tensor& drays) const {
  Dense& dense = *trained.dense;
  const GaussianGradients dbase = zero_gradients(ctx, dense.base, config_.sh_degree);
  Tensor drefined;
  if (dfinal.sh) {
    const Densifier::Gradients d = densifier_->backward(ctx, *dense.saved, dfinal);
    const Stage stage(ctx, "densify");
    gather_backward(ctx, d.candidates, dense.index, dbase);
    if (d.features) {  // several replaced Gaussians may share a voxel
      const long k = d.features.dim(0);
      drefined = ctx.tensor(trained.backbone.refined.shape(), Type::f32, "gradient by refined");
      ctx.fill_zero(drefined);
      const Tensor ones = ctx.upload({k}, std::vector<float>(static_cast<std::size_t>(k), 1.0f));
      const ScatterPlan plan = make_scatter_plan(ctx, dense.rows, ones, drefined.dim(0));
      scatter_rows(ctx, {&plan, d.features, 0, 1, 1, drefined});
    }
  }
  backbone_.backward(ctx, trained.backbone, dcoarse, dbase, drefined, drays);
}

}  // namespace vsplat
