#include "model/train/weight_optimiser.h"

#include <cmath>
#include <set>
#include <string>

#include "model/ops/fit/adamw.h"
#include "model/ops/fit/muon.h"
#include "runtime/fail.h"

namespace vsplat {

WeightOptimiser::Kind WeightOptimiser::kind_of(const TrainConfig& config, const Parameter& p) {
  if (!p.trained || !p.used || is_frozen(config, p.name)) return none;
  if (is_muons(config, p)) return muon;
  return p.decays ? adamw_decaying : adamw;
}

// The values of this run's parameters; zeros for those that `values` lacks.
SideBySide WeightOptimiser::like(const LearntRun& run, const char* what, const Weights& values) const {
  SideBySide out = side_by_side(ctx_, run.shapes, what);
  for (std::size_t i = 0; i < run.names.size(); ++i)
    if (values.has(run.names[i])) ctx_.write(out.parts[i], values.at(run.names[i]).data.data());
  return out;
}

WeightOptimiser::WeightOptimiser(Context& ctx, const TrainConfig& config, const LearntWeights& weights,
                                 const Checkpoint* start)
    : ctx_(ctx), config_(config), weights_(weights) {
  if (!start) return;
  for (const LearntRun& run : weights_.runs()) {
    Moments& moments = moments_.emplace_back();
    if (run.kind == muon) moments.m = like(run, "momentum", start->momentum);
    if (run.kind == adamw || run.kind == adamw_decaying)
      moments = {like(run, "first moments", start->m), like(run, "second moments", start->v)};
    if (config_.ema > 0)
      average_.push_back(like(run, "average", start->average.all().empty() ? start->parameters : start->average));
  }
}

Tensor WeightOptimiser::clipped_norm(Context& ctx) const {
  Tensor out = ctx.tensor({2}, Type::f32, "gradient norm");
  GradientClip clip;
  for (const LearntRun& run : weights_.runs())
    if (run.kind != none) clip.grads.push_back(run.all.gradient);
  clip.max_norm = static_cast<float>(config_.clip_norm);
  clip.out = out;
  gradient_clip(ctx, clip);
  return out;
}

void WeightOptimiser::move(Context& ctx, long number, double lr, const Tensor& norm) const {
  for (std::size_t r = 0; r < moments_.size(); ++r) {
    const LearntRun& run = weights_.runs()[r];
    if (run.kind == none) continue;
    if (run.kind == muon) {
      for (std::size_t i = 0; i < run.names.size(); ++i) {
        const LearntTensor& w = weights_.at(run.names[i]);
        muon_step(ctx, {w.value, w.gradient, moments_[r].m.parts[i], norm, lr, config_.momentum, config_.weight_decay});
      }
      continue;
    }
    AdamwStep a;
    a.param = run.all.value;
    a.grad = run.all.gradient;
    a.m = moments_[r].m.whole;
    a.v = moments_[r].v.whole;
    a.clip = norm;
    a.step = number;
    a.lr = lr;
    a.beta1 = config_.beta1;
    a.beta2 = config_.beta2;
    a.eps = config_.eps;
    a.weight_decay = run.kind == adamw_decaying ? config_.weight_decay : 0;
    adamw_step(ctx, a);
  }
}

void WeightOptimiser::step(Context& ctx, long number, double lr, const Tensor& norm) const {
  move(ctx, number, lr, norm);
  for (std::size_t r = 0; r < average_.size(); ++r)
    average_step(ctx, average_[r].whole, weights_.runs()[r].all.value, config_.ema);
}

void WeightOptimiser::refuse(long number, double loss) const {
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
           number, loss, name, found, number - 1);
  }
  fail(Status::internal, "step {}: the loss is {}, a finite number expected; every gradient is finite", number, loss);
}

void WeightOptimiser::download(long steps_done, Checkpoint& out) const {
  const auto read = [&](const LearntRun& run, const SideBySide& from, Weights& to) {
    for (std::size_t i = 0; i < from.parts.size(); ++i)
      to.set(run.names[i], {run.shapes[i], ctx_.read<float>(from.parts[i])});
  };
  for (std::size_t r = 0; r < moments_.size(); ++r) {
    const LearntRun& run = weights_.runs()[r];
    if (steps_done > 0) {
      read(run, moments_[r].m, run.kind == muon ? out.momentum : out.m);
      read(run, moments_[r].v, out.v);
    }
    if (!average_.empty()) read(run, average_[r], out.average);
  }
}

}  // namespace vsplat
