#include "model/train/trainer.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "model/base/pose_noise.h"
#include "model/networks/params/params.h"
#include "model/ops/fit/adamw.h"
#include "model/ops/fit/muon.h"
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

Trainer::Optimiser Trainer::optimiser_of(const TrainConfig& config, const Parameter& p) {
  if (!p.trained || !p.used || is_frozen(config, p.name)) return none;
  if (is_muons(config, p)) return muon;
  return p.decays ? adamw_decaying : adamw;
}

// The values of this run's parameters; zeros for those that `values` lacks.
SideBySide Trainer::like(const LearntRun& run, const char* what, const Weights& values) const {
  SideBySide out = side_by_side(ctx_, run.shapes, what);
  for (std::size_t i = 0; i < run.names.size(); ++i)
    if (values.has(run.names[i])) ctx_.write(out.parts[i], values.at(run.names[i]).data.data());
  return out;
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
               [&start](const Parameter& p) { return optimiser_of(start.config, p); }),
      state_(start.state) {
  for (const LearntRun& run : weights_.runs()) {
    if (role == Role::helper) break;
    Moments& moments = moments_.emplace_back();
    if (run.kind == muon) moments.m = like(run, "momentum", start.momentum);
    if (run.kind == adamw || run.kind == adamw_decaying)
      moments = {like(run, "first moments", start.m), like(run, "second moments", start.v)};
    if (config_.ema > 0)
      average_.push_back(like(run, "average", start.average.all().empty() ? start.parameters : start.average));
  }
  hold_tuning(ctx, state_);
  memory_ = {rounded(planned_)};
  if (ctx.planning()) return;
  const Plan most = bound();
  memory_.kept_between = most.fits && most.peak <= ctx.memory().limits().total / 2;
}

void Trainer::set_loss(PassOptions& options, long step) const {
  options.ssim_weight = static_cast<float>(config_.ssim_weight);
  options.alpha_weight = static_cast<float>(config_.alpha_weight);
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

Trainer::PartSums Trainer::gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last,
                                     bool recompute) {
  PartSums out;
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

Trainer::PartSums Trainer::gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last) {
  try {
    return gradients(items, first, last, false);
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    memory_ = {};
    return gradients(items, first, last, true);
  }
}

StepReport Trainer::PartSums::means() const {
  StepReport out = report;
  out.psnr = psnr_of(mse);
  out.psnr_coarse = psnr_of(mse_coarse);
  return out;
}

void Trainer::clip(Context& ctx, const Tensor& out) const {
  GradientClip clip;
  for (const LearntRun& run : weights_.runs())
    if (run.kind != none) clip.grads.push_back(run.all.gradient);
  clip.max_norm = static_cast<float>(config_.clip_norm);
  clip.out = out;
  gradient_clip(ctx, clip);
}

void Trainer::move_weights(Context& ctx, const StepReport& report, const Tensor& norm) const {
  for (std::size_t r = 0; r < moments_.size(); ++r) {
    const LearntRun& run = weights_.runs()[r];
    if (run.kind == none) continue;
    if (run.kind == muon) {
      for (std::size_t i = 0; i < run.names.size(); ++i) {
        const LearntTensor& w = weights_.at(run.names[i]);
        muon_step(ctx, {w.value, w.gradient, moments_[r].m.parts[i], norm, report.lr, config_.momentum,
                        config_.weight_decay});
      }
      continue;
    }
    AdamwStep a;
    a.param = run.all.value;
    a.grad = run.all.gradient;
    a.m = moments_[r].m.whole;
    a.v = moments_[r].v.whole;
    a.clip = norm;
    a.step = report.step;
    a.lr = report.lr;
    a.beta1 = config_.beta1;
    a.beta2 = config_.beta2;
    a.eps = config_.eps;
    a.weight_decay = run.kind == adamw_decaying ? config_.weight_decay : 0;
    adamw_step(ctx, a);
  }
}

void Trainer::plan_optimizer() const {
  const Tensor norm = ctx_.tensor({2}, Type::f32, "gradient norm");
  clip(ctx_, norm);
  StepReport first;
  first.step = 1;
  move_weights(ctx_, first, norm);
  for (std::size_t r = 0; r < average_.size(); ++r)
    average_step(ctx_, average_[r].whole, weights_.runs()[r].all.value, config_.ema);
}

StepReport Trainer::step(const std::vector<StepItem>& items) {
  if (items.size() != static_cast<std::size_t>(config_.batch * config_.accumulate))
    fail(Status::internal, "a step of {} objects, {} x {} expected", items.size(), config_.accumulate, config_.batch);
  const bool whole_step = config_.parts == 1 && helpers_.empty() && !ranks_;
  StepReport report = (whole_step ? gradients(items, 0, items.size()) : gradients_in_parts(items)).means();
  const Tensor norm = ctx_.tensor({2}, Type::f32, "gradient norm");
  clip(ctx_, norm);
  report.gradient_norm = static_cast<double>(ctx_.read<float>(norm)[0]);
  if (!std::isfinite(report.loss) || !std::isfinite(report.gradient_norm)) refuse(report.loss);

  const Uncancelled whole(ctx_);
  move_weights(ctx_, report, norm);
  for (std::size_t r = 0; r < average_.size(); ++r)
    average_step(ctx_, average_[r].whole, weights_.runs()[r].all.value, config_.ema);
  ctx_.finish();
  if (!helpers_.empty() || ranks_) moved_ = read_moved(&LearntTensor::value);
  step_ = report.step;
  return report;
}

void Trainer::refuse(double loss) const {
  const Tensor norm = ctx_.tensor({2}, Type::f32, "gradient norm");
  std::set<std::string> moved;
  for (const LearntRun& run : weights_.runs())
    if (run.kind != none) moved.insert(run.names.begin(), run.names.end());
  for (const std::string& name : weights_.names()) {
    if (moved.count(name) == 0) continue;
    gradient_clip(ctx_, {{weights_.at(name).gradient}, 1, 1, norm});
    const float found = ctx_.read<float>(norm)[0];
    if (!std::isfinite(found))
      fail(Status::internal,
           "step {}: the loss is {}, and the gradient by {} has the norm {}: finite numbers expected. The weights are "
           "as step {} left them; a lower learning rate or a longer warm-up may help",
           step_ + 1, loss, name, found, step_);
  }
  fail(Status::internal, "step {}: the loss is {}, a finite number expected; every gradient is finite", step_ + 1,
       loss);
}

Checkpoint Trainer::checkpoint() const {
  Checkpoint out;
  out.config = config_;
  out.step = step_;
  out.parameters = weights_.download(ctx_);
  const auto read = [&](const LearntRun& run, const SideBySide& from, Weights& to) {
    for (std::size_t i = 0; i < from.parts.size(); ++i)
      to.set(run.names[i], {run.shapes[i], ctx_.read<float>(from.parts[i])});
  };
  for (std::size_t r = 0; r < moments_.size(); ++r) {
    const LearntRun& run = weights_.runs()[r];
    if (step_ > 0) {
      read(run, moments_[r].m, run.kind == muon ? out.momentum : out.m);
      read(run, moments_[r].v, out.v);
    }
    if (!average_.empty()) read(run, average_[r], out.average);
  }
  out.state = state_;
  return out;
}

}  // namespace vsplat
