#include "model/network/learnt_weights.h"

#include "model/params/params.h"
#include "runtime/fail.h"

namespace vsplat {

LearntWeights::LearntWeights(Context& ctx, const Config& config, const Weights& weights) {
  for (const Parameter& p : parameters(config)) {
    names_.push_back(p.name);
    LearntTensor& t = tensors_[p.name];
    t.value = ctx.planning() ? ctx.tensor(p.shape, Type::f32, p.name)
                             : ctx.upload(p.shape, weights.of(p).data, Type::f32, p.name);
    if (!p.trained) continue;
    t.gradient = ctx.tensor(p.shape, Type::f32, "gradient of " + p.name);
    ctx.fill_zero(t.gradient);
  }
}

const LearntTensor& LearntWeights::at(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) fail(Status::format, "the model has no weight named {}", name);
  return found->second;
}

void LearntWeights::zero_gradients(Context& ctx) const {
  for (const auto& [name, t] : tensors_)
    if (t.gradient) ctx.fill_zero(t.gradient);
}

Weights LearntWeights::download(Context& ctx) const {
  Weights out;
  for (const auto& [name, t] : tensors_) out.set(name, {t.value.shape(), ctx.read<float>(t.value)});
  return out;
}

}  // namespace vsplat
