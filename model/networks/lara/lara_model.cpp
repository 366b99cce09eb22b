#include "model/networks/lara/lara_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "model/networks/lara/lara_modules.h"
#include "model/networks/layers/running.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/gather.h"
#include "model/ops/volume/compact.h"
#include "model/ops/volume/select.h"
#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

// Shares of the work by stage, for progress: multiplications, roughly.
struct Work {
  double encoder, modulation, lifting, volume, heads, drawing, fine;

  Work(const LaraConfig& c, long view_count) {
    const auto views = static_cast<double>(view_count), lifted = views * static_cast<double>(c.lifted_voxels());
    const double tokens = views * c.tokens() * c.tokens(), d = c.vit_dim, v = static_cast<double>(c.voxels());
    const double ch = c.volume_ch, out = c.out_ch, primitives = static_cast<double>(c.most_primitives());
    encoder = c.vit_depth * tokens * (12 * d * d + 2 * tokens / views * d);
    modulation = tokens * 64 * d;
    lifting = lifted * d * 4;
    volume = c.layers * (v * ch * ch * (27 + 2 + 4) + 2 * lifted * c.lifted_ch() * ch) + 8 * v * ch * out;
    heads = 8 * v * out * (2 * out + c.primitives * c.primitive_size());
    drawing = views * primitives * 2000;
    fine = primitives / 4 * out * (2 * out + 16 * views + c.fine_hidden);
  }
  double total() const { return encoder + modulation + lifting + volume + heads + drawing + fine; }
};

void tap_gaussians(const LaraOptions& options, const std::string& name, const DeviceGaussians& g) {
  options.tap(name + ".means", g.means);
  options.tap(name + ".scales", g.scales);
  options.tap(name + ".quats", g.quats);
  options.tap(name + ".opacities", g.opacities);
  options.tap(name + ".sh", g.sh);
}

}  // namespace

RenderOptions drawing_of(const LaraConfig& config) {
  RenderOptions out;
  out.revision = config.revision == "current" ? SurfelRevision::current : SurfelRevision::lara;
  if (config.negate_camera_centre) out.mirror = std::array<float, 3>{0, 0, 0};
  return out;
}

DrawView draw_view(const LaraConfig& config) {
  const RenderOptions options = drawing_of(config);
  const long edge = config.image;
  return [options, edge](Context& ctx, const DeviceGaussians& gaussians, const Camera& camera) {
    const DevicePicture drawn = render(ctx, gaussians, camera, options);
    return ViewDrawings{drawn.colour.reshaped({1, edge, edge, 3}), drawn.alpha.reshaped({1, edge, edge}),
                        drawn.depth.reshaped({1, edge, edge})};
  };
}

LaraModel::LaraModel(Context& ctx, const LaraConfig& config, const WeightSource& weights) : config_(config) {
  modules_ = made_to_measure(ctx, "the model's weights",
                             [&](Context& c) { return std::make_unique<Modules>(c, config, weights); });
}

LaraModel::~LaraModel() = default;

Tensor LaraModel::draw(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                       const DeviceGaussians& coarse, const LaraOptions& options) const {
  const Stage stage(ctx, "splat");
  const long edge = config_.image;
  const Tensor maps = ctx.tensor({static_cast<long>(cameras.size()), edge, edge, kViewMap}, Type::f32, "view maps");
  if (options.held) {
    view_maps_forward(ctx, {images, *options.held, 0, false, maps});
    return maps;
  }
  const DrawView draw = options.draw ? options.draw : draw_view(config_);
  for (std::size_t v = 0; v < cameras.size(); ++v)
    view_maps_forward(ctx,
                      {images, draw(ctx, coarse, cameras[v]), static_cast<long>(v), config_.kind == "surfel", maps});
  return maps;
}

LaraModel::Coarse LaraModel::coarse(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                    const LaraOptions& options, Saved* saved) const {
  const Modules& m = *modules_;
  const long views = static_cast<long>(cameras.size());
  if (views < 1 || views > config_.view_slots)
    fail(Status::usage, "{} views given, and the network takes 1 to view_slots = {}", views, config_.view_slots);
  const Work work(config_, views);
  Progress progress(ctx, options.progress, work.total());
  const auto tap = [&](const std::string& name, const Tensor& t) {
    if (options.tap && !ctx.planning()) options.tap(name, t);
  };

  Coarse out;
  out.cameras = upload_cameras(ctx, cameras);
  if (saved) saved->cameras = out.cameras;
  progress.begin("encoder", work.encoder);
  Tensor tokens = m.encoder.forward(ctx, images, saved ? saved->encoder.place() : nullptr);
  progress.begin("modulation", work.modulation);
  Tensor features = m.modulation.forward(ctx, tokens, out.cameras, saved ? saved->modulation.place() : nullptr);
  if (saved) out.tokens = tokens;
  tokens = {};
  tap("features", features);
  progress.begin("lifting", work.lifting);
  RowSource lifted = m.lifting.forward(ctx, features, out.cameras, saved ? &saved->lifting : nullptr);
  features = {};
  tap("lifted.samples", lifted.x0);
  tap("lifted.embedded", lifted.x1);
  progress.begin("volume", work.volume);
  out.volume = m.volume.forward(ctx, lifted, views, saved ? &saved->volume : nullptr, tap);
  lifted = {};
  tap("volume", out.volume);
  progress.begin("heads", work.heads);
  out.gaussians = m.coarse_decoder.forward(ctx, out.volume, saved ? saved->coarse_decoder.place() : nullptr);
  {
    const Stage stage(ctx, "selection");
    SelectForward kept;
    kept.opacities = out.gaussians.opacities;
    kept.selection = Selection::opacity;
    kept.opacity_threshold = static_cast<float>(config_.opacity_threshold);
    kept.flags = ctx.tensor({out.gaussians.count()}, Type::u32, "selection.flags");
    select_forward(ctx, kept);
    out.index = compact(ctx, kept.flags, options.planned_kept);
  }
  if (saved) saved->volume_shape = out.volume.shape();
  if (saved && !options.fine) return out;
  progress.begin("splat", work.drawing);
  out.maps = draw(ctx, images, cameras, out.gaussians, options);
  if (saved && !options.held && !options.draw) saved->drawn = out.gaussians, saved->drawn_from = cameras;
  return out;
}

LaraResult LaraModel::fine(Context& ctx, const Coarse& state, const LaraOptions& options, Saved* saved) const {
  LaraResult out;
  out.coarse = state.gaussians;
  out.index = state.index;
  out.volume = state.volume;
  // The host needs the indices for the fine decoder's blocks and for the result.
  out.kept.resize(static_cast<std::size_t>(state.index.dim(0)));
  if (!ctx.planning()) out.kept = ctx.read<int>(state.index);
  {
    const Stage stage(ctx, "selection");
    out.final = gather_forward(ctx, state.gaussians, state.index);
  }
  const Work work(config_, state.cameras.count());
  Progress progress(ctx, options.progress, work.total());
  progress.skip(work.total() - work.fine);
  progress.begin("refinement", work.fine);
  LaraFineDecoder::Input in{state.volume, out.final.means, out.kept, state.maps, state.cameras};
  if (options.tap) {
    const Tensor samples = modules_->fine_decoder.samples(ctx, in);
    if (!ctx.planning()) options.tap("fine.samples", samples);
  }
  const Tensor fine = modules_->fine_decoder.forward(ctx, in);
  if (options.tap && !ctx.planning()) options.tap("fine.output", fine);
  const Stage stage(ctx, "decode");
  const long p = state.index.dim(0), features = config_.fine_features;
  add_columns(ctx, {fine, out.final.sh.reshaped({p, 3L * config_.sh_count()}), 0, features});
  if (features > 0) {
    out.features = ctx.tensor({p, features}, Type::f32, "features of the kept");
    ctx.fill_zero(out.features);
    add_columns(ctx, {fine, out.features, 0, 0, features});
  }
  if (saved) saved->fine = std::move(in), saved->index = state.index;
  return out;
}

LaraResult LaraModel::forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                              const LaraOptions& options) const {
  const MemoryPlan whole = plan(ctx, static_cast<long>(cameras.size()), options.planned_kept);
  if (whole.peak > ctx.memory().limits().total)
    fail(Status::memory,
         "not enough device memory: with {} of {} primitives kept the run needs {:.3f} GiB, {:.3f} GiB may be used "
         "({}, fewer views, a smaller model or another device)",
         whole.selected, config_.most_primitives(), gib(whole.peak), gib(ctx.memory().limits().total),
         Option::max_memory);
  {
    const auto planner = ctx.planner();
    coarse(*planner, images, cameras, options, nullptr);
    ctx.memory().commit(planner->memory());
  }
  const Coarse state = coarse(ctx, images, cameras, options, nullptr);
  {  // the fine half's memory is known only now
    const auto planner = ctx.planner();
    fine(*planner, state, options, nullptr);
    refuse_unless_fits(*planner, fmt::format("the fine stage at {} kept primitives", state.index.dim(0)));
    ctx.memory().commit(planner->memory());
  }
  const LaraResult out = fine(ctx, state, options, nullptr);
  if (options.tap) {
    tap_gaussians(options, "coarse", out.coarse);
    tap_gaussians(options, "final", out.final);
  }
  ctx.finish();
  return out;
}

MemoryPlan LaraModel::plan(const Context& ctx, long views, long kept) const {
  MemoryPlan out;
  out.weights = ctx.memory().live();
  const auto first = ctx.planner();
  const long edge = config_.image;
  std::vector<Camera> cameras(static_cast<std::size_t>(views));
  for (Camera& camera : cameras) {
    camera.width = camera.height = config_.image;
    camera.fx = camera.fy = config_.image;
    camera.cx = camera.cy = config_.image / 2.0;
  }
  LaraOptions options;
  options.planned_kept = kept;
  const Tensor images = first->tensor({views, edge, edge, 3}, Type::f32, "pictures");
  const Coarse state = coarse(*first, images, cameras, options, nullptr);
  out.selected = state.index.dim(0);
  const auto second = first->planner();  // keeps the first half's slabs; the second half adds its own
  fine(*second, state, options, nullptr);
  out.peak = second->memory().peak();
  for (const Context* part : {first.get(), second.get()})
    for (const StageMemory& stage : part->stage_memory())
      if (!stage.stage.empty()) out.stages.push_back(stage);
  return out;
}

MemoryPlan LaraModel::plan(const Context& ctx, const LaraConfig& config, const Weights& weights, long views,
                           long kept) {
  const auto planner = ctx.planner();
  const LaraModel model(*planner, config, weights);
  return model.plan(*planner, views, kept);
}

}  // namespace vsplat
