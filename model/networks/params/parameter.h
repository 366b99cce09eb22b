// One of a model's parameters: what is known of it without its values.
#pragma once
#include <string>

#include "runtime/tensor.h"

namespace vsplat {

enum class Init {
  fan_in,       // uniform in +-1/sqrt(fan_in): Linear and dense convolutions, weights and biases
  xavier,       // uniform in +-sqrt(6/(fan_in + fan_out)): the heads' weights
  submanifold,  // normal with variance 1/fan_in
  normal,       // the same, of what is learnt as it is
  position,     // normal with deviation 0.02
  layer_scale,  // 1e-5
  zeros,
  ones,
  sobol  // the fixed places of the fine primitives within their voxel
};

struct Parameter {
  std::string name;  // that of the reference's state dict
  Shape shape;       // PyTorch's layout
  Init init = Init::zeros;
  long fan_in = 0, fan_out = 0;  // where `init` needs them
  bool trained = true;           // false: a buffer, stored but not learnt
  bool decays = true;            // whether AdamW's weight decay applies: to all but biases and LayerNorms
  // Whether the result of `levels` and `selection` can depend on it at all. One that it cannot is not touched by
  // training: no decay either.
  bool used = true;

  long count() const;
};

// Error(format) that names the parameter and both shapes, where `found` is not the parameter's.
void require_shape(const Parameter& parameter, const Shape& found);

}  // namespace vsplat
