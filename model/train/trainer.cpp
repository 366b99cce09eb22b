#include "model/train/trainer.h"

#include <algorithm>
#include <cmath>

#include "model/base/pose_noise.h"
#include "model/networks/params/params.h"
#include "model/ops/volume/select.h"
#include "model/train/half_size.h"
#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/tuning/held_tuning.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

// Index of this stream among the seed's random streams.
constexpr std::uint32_t kNoiseStream = 2;

double psnr_of(double mse) { return -10 * std::log10(std::max(mse, 1e-12)); }

// Means over a level's views, read from the device.
struct Means {
  double loss = 0, mse = 0;  // over all views; over the views that the PSNR uses
};

Means read_means(Context& ctx, const LevelLoss& views, std::size_t inputs) {
  Means out;
  if (ctx.planning()) return out;
  const std::size_t first = inputs < views.size() ? inputs : 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const std::vector<float> values = ctx.read<float>(views[v]);
    out.loss += static_cast<double>(values[0]) / static_cast<double>(views.size());
    if (v >= first) out.mse += static_cast<double>(values[1]) / static_cast<double>(views.size() - first);
  }
  return out;
}

}  // namespace

// Allocates slabs for weights, gradients and optimiser state at once, with their exact sizes.
Context& Trainer::with_slabs(Context& ctx, const Checkpoint& start, Role role) {
  if (ctx.planning()) return ctx;
  const auto planner = ctx.planner();
  const Trainer counted(*planner, start, 0, role);
  if (planner->memory().peak() > ctx.memory().limits().total)
    fail(Status::memory,
         "not enough device memory: the weights, their gradients and the optimiser's state take {:.3f} GiB, {:.3f} GiB "
         "may be used ({}, a smaller model or another device)",
         gib(planner->memory().peak()), gib(ctx.memory().limits().total), Option::max_memory);
  ctx.memory().commit(planner->memory());
  return ctx;
}

Trainer::Trainer(Context& ctx, const Checkpoint& start, long planned_selected, const std::vector<Context*>& helpers,
                 Ranks* ranks)
    : Trainer(ctx, start, planned_selected, ranks && ranks->rank() > 0 ? Role::helper : Role::optimiser) {
  for (Context* helper : helpers)
    helpers_.push_back(std::unique_ptr<Trainer>(new Trainer(*helper, start, planned_selected, Role::helper)));
  if (ranks && ranks->count() > 1) ranks_ = ranks;
}

Trainer::Trainer(Context& ctx, const Checkpoint& start, long planned_selected, Role role)
    : ctx_(with_slabs(ctx, start, role)),
      config_(start.config),
      planned_(planned_selected),
      step_(start.step),
      weights_(ctx, parameters(start.config.model), start.parameters,
               [&start](const Parameter& p) { return WeightOptimiser::kind_of(start.config, p); }),
      optimiser_(ctx, config_, weights_, role == Role::helper ? nullptr : &start),
      state_(start.state) {
  hold_tuning(ctx, state_);
  memory_ = {rounded(planned_)};
  if (ctx.planning()) return;
  const Plan most = bound();
  memory_.kept_between = most.fits && most.peak <= ctx.memory().limits().total / 2;
}

void Trainer::set_loss(PassOptions& options, long step) const {
  options.ssim_weight = static_cast<float>(config_.ssim_weight);
  options.alpha_weight = static_cast<float>(config_.alpha_weight);
  options.sparsity_weight = static_cast<float>(config_.sparsity_weight);
  options.forward.fine = step > config_.fine_after;
  if (step > config_.surface_after)
    options.surface = {static_cast<float>(config_.distortion_weight), static_cast<float>(config_.normal_weight)};
}

PassViews Trainer::upload(Context& ctx, const StepObject& object, PassOptions& options) const {
  const TrainingViews& views = *object.given.views;
  const long s = config_.model.image(), n = views.inputs, all = static_cast<long>(views.cameras.size());
  const auto pixels = static_cast<std::size_t>(s * s * 3);
  const bool whole = ctx.planning() || views.pictures.size() == pixels * views.cameras.size();
  if (n < 1 || n > all || !whole)
    fail(Status::internal, "{}: {} values for {} views, {} of them inputs, of {} x {} pixels", views.object,
         views.pictures.size(), all, n, s, s);
  const auto picture = [&](long v) {
    return ctx.planning() ? nullptr : views.pictures.data() + static_cast<std::size_t>(v) * pixels;
  };
  PassViews out;
  out.inputs = ctx.upload({n, s, s, 3}, picture(0), Type::f32, "input pictures");
  out.cameras = views.cameras;
  if (config_.pose_noise > 0)
    out.given = noisy_cameras({views.cameras.begin(), views.cameras.begin() + n}, config_.pose_noise, config_.seed,
                              object.noise_draw, views.object);
  for (long v = 0; v < all; ++v) {
    // A plan assumes full size.
    const bool half =
        !ctx.planning() && is_half_size(config_.half_size, config_.seed, object.noise_draw, views.object, v);
    const long side = half ? s / 2 : s;
    const Camera& camera = views.cameras[static_cast<std::size_t>(v)];
    out.drawn.push_back(half ? half_size(camera) : camera);
    const std::vector<float> small = half ? half_size(picture(v), s, 3) : std::vector<float>();
    out.targets.push_back(
        ctx.upload({1, side, side, 3}, half ? small.data() : picture(v), Type::f32, "target picture"));
    out.backgrounds.push_back(v < n ? object.given.input_background : views.background);
    if (views.rgba.empty()) continue;
    const std::vector<std::uint8_t>& rgba = views.rgba.at(static_cast<std::size_t>(v));
    out.rgba.push_back(
        rgba.empty() ? Tensor()
                     : ctx.upload({side, side, 4}, half ? half_size(rgba, s, 4) : rgba, Type::u8, "target alpha"));
  }
  if (config_.model.noise() == 0) return out;
  const Tensor noise = options.forward.noise = ctx.tensor({config_.model.noise()}, Type::f32, "noise");
  if (object.given.noise)
    ctx.write(noise, object.given.noise->data());
  else
    logistic_noise(ctx, noise, config_.seed, object.noise_draw, kNoiseStream);
  return out;
}

ShardSums Trainer::gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last, bool recompute) {
  ShardSums out;
  StepReport& report = out.report;
  report.step = step_ + 1;
  report.lr = learning_rate(config_.schedule, report.step);
  report.temperature = vsplat::temperature(config_.schedule, report.step);
  weights_.zero_gradients(ctx_);
  const auto network = make_network(ctx_, config_.model, weights_);
  const double share = 1.0 / static_cast<double>(items.size());
  for (std::size_t i = first; i < last; ++i) {
    PassOptions options;
    set_loss(options, report.step);
    options.forward.selection = items[i].selection;
    options.forward.temperature = report.temperature;
    options.scale = static_cast<float>(share);
    const StepObject object{items[i], static_cast<std::uint32_t>(static_cast<std::size_t>(step_) * items.size() + i)};
    // the loss gains terms
    const bool more = step_ > 0 && (step_ == config_.fine_after || step_ == config_.surface_after);
    if (!memory_.kept_between || more) memory_ = {rounded(planned_), recompute, 0, memory_.kept_between};
    const PassResult result = finish_pass(ctx_, *network, draw_in_memory(ctx_, *network, object, options, memory_, -1));
    const auto inputs = static_cast<std::size_t>(items[i].views->inputs);
    const Means coarse = read_means(ctx_, result.coarse, inputs);
    const Means fine = result.final.empty() ? coarse : read_means(ctx_, result.final, inputs);
    report.loss += share * (result.final.empty() ? coarse.loss : coarse.loss + fine.loss);
    if (result.rays)
      report.loss +=
          share * config_.model.as<Config>()->share_loss_weight * static_cast<double>(ctx_.read<float>(result.rays)[0]);
    out.mse += share * fine.mse;
    out.mse_coarse += share * coarse.mse;
    report.selected += share * static_cast<double>(result.selected) / static_cast<double>(config_.model.selectable());
    report.most_selected = std::max(report.most_selected, result.selected);
    report.intersections = std::max(report.intersections, result.intersections);
  }
  return out;
}

ShardSums Trainer::gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last) {
  try {
    return gradients(items, first, last, false);
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    memory_ = {};
    return gradients(items, first, last, true);
  }
}

StepReport ShardSums::means() const {
  StepReport out = report;
  out.psnr = psnr_of(mse);
  out.psnr_coarse = psnr_of(mse_coarse);
  return out;
}

StepReport Trainer::step(const std::vector<StepItem>& items) {
  if (items.size() != static_cast<std::size_t>(config_.batch * config_.accumulate))
    fail(Status::internal, "a step of {} objects, {} x {} expected", items.size(), config_.accumulate, config_.batch);
  const bool whole_step = config_.parts == 1 && helpers_.empty() && !ranks_;
  StepReport report = (whole_step ? gradients(items, 0, items.size()) : gradients_in_parts(items)).means();
  const Tensor norm = optimiser_.clipped_norm(ctx_);
  report.gradient_norm = static_cast<double>(ctx_.read<float>(norm)[0]);
  if (!std::isfinite(report.loss) || !std::isfinite(report.gradient_norm)) optimiser_.refuse(report.step, report.loss);

  const Uncancelled whole(ctx_);
  optimiser_.step(ctx_, report.step, report.lr, norm);
  ctx_.finish();
  if (!helpers_.empty() || ranks_) moved_ = read_moved(&LearntTensor::value);
  step_ = report.step;
  return report;
}

Checkpoint Trainer::checkpoint() const {
  Checkpoint out;
  out.config = config_;
  out.step = step_;
  out.parameters = weights_.download(ctx_);
  optimiser_.download(step_, out);
  out.state = state_;
  return out;
}

}  // namespace vsplat
