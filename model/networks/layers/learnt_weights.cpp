#include "model/networks/layers/learnt_weights.h"

#include <algorithm>
#include <utility>

#include "model/networks/params/params.h"
#include "runtime/fail.h"
#include "runtime/side_by_side.h"

namespace vsplat {
namespace {

// Small enough for any device and to be allocated easily, large enough for few launches.
constexpr std::size_t kLongestRun = std::size_t{64} << 20;

}  // namespace

LearntWeights::LearntWeights(Context& ctx, const Config& config, const Weights& weights, const KindOf& kind_of)
    : LearntWeights(ctx, parameters(config), weights, kind_of) {}

LearntWeights::LearntWeights(Context& ctx, const std::vector<Parameter>& listed, const Weights& weights,
                             const KindOf& kind_of) {
  // Buffers first, then by kind.
  std::map<std::pair<bool, int>, std::vector<Parameter>> kinds;
  for (const Parameter& p : listed) {
    names_.push_back(p.name);
    kinds[{p.trained, p.trained && kind_of ? kind_of(p) : 0}].push_back(p);
  }
  const std::size_t longest = std::min(kLongestRun, ctx.memory().limits().max_alloc);
  for (const auto& [kind, all] : kinds) {
    std::vector<Shape> shapes;
    for (const Parameter& p : all) shapes.push_back(p.shape);
    std::size_t first = 0;
    for (const std::size_t count : split_to_fit(ctx, shapes, longest)) {
      LearntRun& run = runs_.emplace_back();
      run.kind = kind.second;
      run.shapes.assign(shapes.begin() + static_cast<std::ptrdiff_t>(first),
                        shapes.begin() + static_cast<std::ptrdiff_t>(first + count));
      const SideBySide values = side_by_side(ctx, run.shapes, "weights");
      const SideBySide gradients = kind.first ? side_by_side(ctx, run.shapes, "gradients") : SideBySide();
      run.all = {values.whole, gradients.whole};
      for (std::size_t i = 0; i < count; ++i) {
        const Parameter& p = all[first + i];
        run.names.push_back(p.name);
        tensors_[p.name] = {values.parts[i], kind.first ? gradients.parts[i] : Tensor()};
        if (!ctx.planning()) ctx.write(values.parts[i], weights.of(p).data.data());
      }
      first += count;
    }
  }
}

const LearntTensor& LearntWeights::at(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) fail(Status::format, "the model has no weight named {}", name);
  return found->second;
}

void LearntWeights::zero_gradients(Context& ctx) const {
  for (const LearntRun& run : runs_)
    if (run.all.gradient) ctx.fill_zero(run.all.gradient);
}

Weights LearntWeights::download(Context& ctx) const {
  Weights out;
  for (const auto& [name, t] : tensors_) out.set(name, {t.value.shape(), ctx.read<float>(t.value)});
  return out;
}

}  // namespace vsplat
