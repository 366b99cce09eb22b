// A model's weights in training: on the device, in PyTorch's layout, each with its gradient.
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
  Tensor value;     // f32, in the shape that parameters() lists
  Tensor gradient;  // shape of `value`; empty for a buffer, which is not learnt
};

// Weights stored contiguously, so that an optimiser updates all of them in one launch.
struct LearntRun {
  int kind = 0;                    // value of KindOf
  std::vector<std::string> names;  // in storage order
  std::vector<Shape> shapes;
  LearntTensor all;  // one-dimensional, side_by_side() of `shapes`; zeros in the gaps
};

class LearntWeights {
 public:
  // Kind of a weight. Weights of one kind share a run.
  using KindOf = std::function<int(const Parameter&)>;

  // Uploads what parameters(config) lists. Gradients start as zeros. Error(format) names a weight that is missing or
  // has the wrong shape. On a planning context `weights` may be empty, so that models larger than memory can be
  // planned. Without `kind_of`, all are of one kind. Buffers have a run of their own.
  LearntWeights(Context& ctx, const Config& config, const Weights& weights, const KindOf& kind_of = {});
  // The same for a given list of parameters.
  LearntWeights(Context& ctx, const std::vector<Parameter>& listed, const Weights& weights, const KindOf& kind_of = {});

  // Error(format) names a missing weight.
  const LearntTensor& at(const std::string& name) const;
  // In the state dict's order.
  const std::vector<std::string>& names() const { return names_; }
  // The runs of all weights; a kind has several if one would exceed the largest allocation.
  const std::vector<LearntRun>& runs() const { return runs_; }

  void zero_gradients(Context& ctx) const;
  Weights download(Context& ctx) const;

 private:
  std::vector<std::string> names_;
  std::map<std::string, LearntTensor> tensors_;
  std::vector<LearntRun> runs_;
};

}  // namespace vsplat
