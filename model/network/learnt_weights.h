// A model's weights while they are learnt: on the device, in PyTorch's layout, each with its gradient.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "model/params/config.h"
#include "model/params/weights.h"
#include "runtime/context.h"

namespace vsplat {

struct LearntTensor {
  Tensor value;     // f32, the shape that parameters() gives it
  Tensor gradient;  // as `value`; none for a buffer, which is not learnt
};

class LearntWeights {
 public:
  // Uploads what parameters(config) lists. Gradients start as zeros. Error(format) names what is missing or misshapen.
  // A context that only plans asks for no values: `weights` may be empty, so that a model beyond memory is planned.
  LearntWeights(Context& ctx, const Config& config, const Weights& weights);

  // Error(format) names what is missing.
  const LearntTensor& at(const std::string& name) const;
  // In the state dict's order.
  const std::vector<std::string>& names() const { return names_; }

  void zero_gradients(Context& ctx) const;
  Weights download(Context& ctx) const;

 private:
  std::vector<std::string> names_;
  std::map<std::string, LearntTensor> tensors_;
};

}  // namespace vsplat
