#include "model/networks/vsplat/vsplat_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/networks/layers/running.h"
#include "model/networks/vsplat/vsplat_modules.h"
#include "model/ops/dense/gather.h"
#include "model/render/render.h"
#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/units.h"

namespace vsplat {

namespace {

// Shares of the work by stage, for progress: multiplications, roughly.
struct Work {
  double encoder, poses = 0, modulation, lifting, volume, heads, fine;

  Work(const Config& c, long view_count, long selected) {
    const auto views = static_cast<double>(view_count);
    const double tokens = views * c.tokens() * c.tokens(), d = c.vit_dim, v = static_cast<double>(c.voxels()),
                 ch = c.volume_ch;
    encoder = c.vit_depth * tokens * (12 * d * d + 2 * tokens / views * d);
    if (c.predicts_poses()) {
      const double m = c.share_dim, r = c.share_ray_dim, window = tokens / views / (c.share_splits * c.share_splits);
      poses = tokens * (d * c.share_reduce[0] + static_cast<double>(c.share_reduce[0]) * c.share_reduce[1] +
                        c.share_match_layers * (m * m * (8 + 6 * c.share_match_mlp) + 2 * views * window * m) +
                        c.share_ray_layers * (r * r * (4 + 2 * c.share_ray_mlp) + 2 * tokens * r));
    }
    modulation = tokens * 3 * d * d;
    lifting = (v + tokens) * d * 4 * ch;
    volume = v * 27 * ch * ch * 12;
    heads = v * 5 * ch * ch;
    fine = static_cast<double>(selected) *
           (27.0 * c.voxel_ch * c.voxel_ch * (1 + 4 * c.voxel_levels) + 3.0 * c.fine_dim * c.fine_dim);
  }
  double total() const { return encoder + poses + modulation + lifting + volume + heads + fine; }
};

// Plans the rendering of the result, after the network's own tensors are freed: a picture of the network's size.
// Assumes that a Gaussian touches RenderOptions::assumed_tiles tiles, since the actual number is known only when it is
// rendered.
std::unique_ptr<Context> plan_picture(const Context& ctx, const Arena& after_network, long gaussians,
                                      const Config& config) {
  auto plan = ctx.planner();
  plan->memory().commit(after_network);
  const Stage stage(*plan, "splat");
  const DeviceGaussians g{plan->tensor({gaussians, 3}), plan->tensor({gaussians, 3}), plan->tensor({gaussians, 4}),
                          plan->tensor({gaussians}), plan->tensor({gaussians, config.sh_count(), 3})};
  Camera camera;
  camera.width = camera.height = config.image;
  camera.fx = camera.fy = config.image;
  camera.cx = camera.cy = config.image / 2.0;
  render(*plan, g, camera, {});
  return plan;
}

}  // namespace

VsplatModel::VsplatModel(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  modules_ = made_to_measure(ctx, "the model's weights",
                             [&](Context& c) { return std::make_unique<Modules>(c, config, weights); });
}

VsplatModel::~VsplatModel() = default;

VsplatModel::Coarse VsplatModel::coarse(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                                        const ForwardOptions& options, Saved* saved) const {
  const Modules& m = *modules_;
  const Work work(config_, cameras.count(), options.planned_selected);
  Progress progress(ctx, options.progress, work.total());
  const auto tap = [&](const std::string& name, const Tensor& t) {
    if (options.tap && !ctx.planning()) options.tap(name, t);
  };
  Vit::Saved* const encoder = saved ? saved->encoder.place() : nullptr;
  PoseModulation::Saved* const modulation = saved ? saved->modulation.place() : nullptr;
  Saved::Volume* const volume = saved ? saved->volume.place() : nullptr;
  CoarseHeads::Saved* const coarse_heads = saved ? saved->coarse_heads.place() : nullptr;

  Coarse out;
  progress.begin("encoder", work.encoder);
  Tensor tokens = m.encoder.forward(ctx, images, encoder);
  if (m.rays) {
    progress.begin("poses", work.poses);
    out.rays = m.rays->forward(ctx, tokens, saved ? saved->rays.place() : nullptr, tap);
  }
  progress.begin("modulation", work.modulation);
  out.features = m.modulation.forward(ctx, tokens, cameras, modulation, out.rays);
  if (saved) out.tokens = tokens;
  tokens = {};
  tap("features", out.features);
  progress.begin("lifting", work.lifting);
  Tensor lifted = m.lifting.forward(ctx, out.features, cameras, volume ? &volume->lifting : nullptr);
  progress.begin("volume", work.volume);
  out.volume = m.volume.forward(ctx, std::move(lifted), volume ? &volume->network : nullptr);
  tap("volume", out.volume);
  progress.begin("heads", work.heads);
  CoarseHeads::Output heads = m.coarse_heads.forward(ctx, out.volume, coarse_heads);
  tap("logits", heads.logits);
  out.gaussians = heads.gaussians;

  if (config_.levels != "coarse") {
    progress.begin("selection", 0);
    SelectionOptions selection;
    selection.temperature = static_cast<float>(options.temperature);
    selection.seed = options.selection_seed;
    selection.forced = options.selection;
    selection.planned = options.planned_selected;
    selection.noise = options.noise;
    out.selected = select_voxels(ctx, config_, heads.logits, heads.gaussians.opacities, selection,
                                 saved ? &saved->selection : nullptr);
    out.gaussians.opacities = out.selected.opacities;
    tap("confidence", out.selected.factor);
  }
  return out;
}

DeviceGaussians VsplatModel::fine(Context& ctx, const Coarse& state, const DeviceCameras& cameras,
                                  const ForwardOptions& options, Saved* saved, Tensor* features) const {
  if (config_.levels == "coarse") return state.gaussians;
  DeviceGaussians skeleton;
  {
    const Stage stage(ctx, "selection");
    skeleton = gather_forward(ctx, state.gaussians, state.selected.index);
  }
  if (config_.levels == "skeletal") return skeleton;

  const auto tap = [&](const char* name, const Tensor& t) {
    if (options.tap && t && !ctx.planning()) options.tap(name, t);
  };
  const Work work(config_, cameras.count(), options.planned_selected);
  Progress progress(ctx, options.progress, work.total());
  progress.skip(work.total() - work.fine);
  progress.begin("refinement", work.fine);
  Saved::Fine* const kept = saved ? saved->fine.place() : nullptr;
  if (saved && !kept) hold_fine_inputs(*saved, state, skeleton);
  Refinement::Output refined =
      modules_->refinement.forward(ctx, {state.volume, state.features, &cameras, skeleton.means, state.selected.index},
                                   kept ? &kept->refinement : nullptr);
  tap("projected", refined.projected);
  tap("refined", refined.refined);
  refined.projected = {};
  if (features) *features = refined.refined;
  progress.begin("decode", 0);
  return modules_->fine_heads.forward(ctx, refined.refined, skeleton, kept ? &kept->heads : nullptr);
}

ForwardResult VsplatModel::forward(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                                   const ForwardOptions& options) const {
  const MemoryPlan whole =
      plan(ctx, cameras.count(),
           options.selection ? static_cast<long>(options.selection->size()) : options.planned_selected);
  if (whole.peak > ctx.memory().limits().total)
    fail(Status::memory,
         "not enough device memory: with {} of {} voxels selected the run needs {:.3f} GiB, {:.3f} GiB may be used "
         "({}, {}, fewer views, a smaller model or another device)",
         whole.selected, config_.voxels(), gib(whole.peak), gib(ctx.memory().limits().total), Option::max_memory,
         Option::assume_selected);

  {
    const auto planner = ctx.planner();
    coarse(*planner, images, cameras, options, nullptr);
    ctx.memory().commit(planner->memory());
  }
  const Coarse state = coarse(ctx, images, cameras, options, nullptr);

  {  // the fine half's memory is known only now
    const auto planner = ctx.planner();
    fine(*planner, state, cameras, options, nullptr);
    refuse_unless_fits(*planner, fmt::format("the fine stage at {} selected voxels", state.selected.count));
    ctx.memory().commit(planner->memory());
  }
  ForwardResult out;
  out.coarse = state.gaussians;
  out.rays = state.rays;
  out.final = fine(ctx, state, cameras, options, nullptr, &out.refined);
  if (state.selected.index) out.selected = ctx.read<int>(state.selected.index);
  if (options.tap) {
    const auto level = [&](const std::string& name, const DeviceGaussians& g) {
      options.tap(name + ".means", g.means);
      options.tap(name + ".scales", g.scales);
      options.tap(name + ".quats", g.quats);
      options.tap(name + ".opacities", g.opacities);
      options.tap(name + ".sh", g.sh);
    };
    level("coarse", out.coarse);
    level("final", out.final);
  }
  ctx.finish();
  return out;
}

MemoryPlan VsplatModel::plan(const Context& ctx, long views, long selected) const {
  MemoryPlan out;
  out.weights = ctx.memory().live();
  const auto first = ctx.planner();
  const long edge = config_.image;
  ForwardOptions options;
  options.planned_selected = selected;
  const Tensor images = first->tensor({views, edge, edge, 3}, Type::f32, "pictures");
  const DeviceCameras cameras = upload_cameras(*first, std::vector<Camera>(static_cast<std::size_t>(views)));
  const Coarse state = coarse(*first, images, cameras, options, nullptr);
  out.selected = state.selected.count;
  const auto second = first->planner();  // keeps the first half's slabs; the second half adds its own
  const DeviceGaussians gaussians = fine(*second, state, cameras, options, nullptr);
  const auto third = plan_picture(ctx, second->memory(), gaussians.count(), config_);
  out.peak = std::max(second->memory().peak(), third->memory().peak());
  for (const Context* part : {first.get(), second.get(), third.get()})
    for (const StageMemory& stage : part->stage_memory())
      if (!stage.stage.empty()) out.stages.push_back(stage);
  return out;
}

MemoryPlan VsplatModel::plan(const Context& ctx, const Config& config, const Weights& weights, long views,
                             long selected) {
  const auto planner = ctx.planner();
  const VsplatModel model(*planner, config, weights);
  return model.plan(*planner, views, selected);
}

long VsplatModel::most_gaussians(const Config& config) {
  return config.levels == "fine" ? config.voxels() * (config.fine_count + 1) : config.voxels();
}

}  // namespace vsplat
