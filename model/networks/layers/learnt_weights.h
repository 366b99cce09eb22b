// A model's weights while they are learnt: on the device, in PyTorch's layout, each with its gradient.
#pragma once
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "model/networks/params/config.h"
#include "model/networks/params/parameter.h"
#include "model/networks/params/weights.h"
#include "runtime/context.h"

namespace vsplat {

struct LearntTensor {
  Tensor value;     // f32, the shape that parameters() gives it
  Tensor gradient;  // as `value`; none for a buffer, which is not learnt
};

// Weights that lie side by side, so that an optimiser moves all of them in one launch.
struct LearntRun {
  int kind = 0;                    // as LearntWeights was told
  std::vector<std::string> names;  // in the order in which they lie
  std::vector<Shape> shapes;
  LearntTensor all;  // one-dimensional, side_by_side() of `shapes`; zeros between them
};

class LearntWeights {
 public:
  // Which weights lie in one run: those of one kind.
  using KindOf = std::function<int(const Parameter&)>;

  // Uploads what parameters(config) lists. Gradients start as zeros. Error(format) names what is missing or misshapen.
  // A context that only plans asks for no values: `weights` may be empty, so that a model beyond memory is planned.
  // Without `kind_of` all are of one kind. Buffers have a run of their own.
  LearntWeights(Context& ctx, const Config& config, const Weights& weights, const KindOf& kind_of = {});
  // The same of a list of them.
  LearntWeights(Context& ctx, const std::vector<Parameter>& listed, const Weights& weights, const KindOf& kind_of = {});

  // Error(format) names what is missing.
  const LearntTensor& at(const std::string& name) const;
  // In the state dict's order.
  const std::vector<std::string>& names() const { return names_; }
  // Of every weight; several of one kind where they would be longer than one piece of memory.
  const std::vector<LearntRun>& runs() const { return runs_; }

  void zero_gradients(Context& ctx) const;
  Weights download(Context& ctx) const;

 private:
  std::vector<std::string> names_;
  std::map<std::string, LearntTensor> tensors_;
  std::vector<LearntRun> runs_;
};

}  // namespace vsplat
