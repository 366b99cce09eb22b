// The description of a model's parameter, without its values.
#pragma once
#include <string>

#include "runtime/tensor.h"

namespace vsplat {

enum class Init {
  fan_in,       // uniform in +-1/sqrt(fan_in): Linear and dense convolutions, weights and biases
  xavier,       // uniform in +-sqrt(6/(fan_in + fan_out)): the heads' weights
  submanifold,  // normal with variance 1/fan_in
  normal,       // the same, for tensors that are trained as they are
  position,     // normal with deviation 0.02
  layer_scale,  // 1e-5
  zeros,
  ones,
  sobol  // the fixed offsets of the fine primitives within their voxel
};

struct Parameter {
  std::string name;  // as in the reference's state dict
  Shape shape;       // PyTorch's layout
  Init init = Init::zeros;
  long fan_in = 0, fan_out = 0;  // if `init` needs them
  bool trained = true;           // false: a buffer, stored but not trained
  bool decays = true;            // whether AdamW's weight decay applies: false for biases and LayerNorms
  // Whether the result can depend on it, given `levels` and `selection`. If not, training does not change it, not even
  // by decay.
  bool used = true;

  long count() const;
};

// Error(format) names the parameter and both shapes if `found` is not the parameter's.
void require_shape(const Parameter& parameter, const Shape& found);

}  // namespace vsplat
