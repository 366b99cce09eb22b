// The one list of what a model is made of: every parameter's name (that of the reference's state dict), shape in
// PyTorch's layout, and how it is initialised. Weight files, initial weights and the optimiser all go by it.
#pragma once
#include <string>
#include <vector>

#include "model/params/config.h"
#include "runtime/tensor.h"

namespace vsplat {

enum class Init {
  fan_in,       // uniform in +-1/sqrt(fan_in): Linear and dense convolutions, weights and biases
  xavier,       // uniform in +-sqrt(6/(fan_in + fan_out)): the heads' weights
  submanifold,  // normal with variance 1/fan_in
  position,     // normal with deviation 0.02
  zeros,
  ones,
  sobol  // the fixed places of the fine primitives within their voxel
};

struct Parameter {
  std::string name;
  Shape shape;
  Init init = Init::zeros;
  long fan_in = 0, fan_out = 0;  // where `init` needs them
  bool trained = true;           // false: a buffer, stored but not learnt

  long count() const;
};

// In the state dict's order. Depends on sizes, `use_projected` and `refine_out_kernel`; every module exists for every
// value of `selection` and `levels`.
std::vector<Parameter> parameters(const Config& config);

// Whether the result of `levels` and `selection` can depend on a parameter at all. One that it cannot is not touched by
// training: no decay either.
bool is_used(const Config& config, const std::string& name);

// Whether AdamW's weight decay applies: to all but biases and LayerNorms.
bool decays(const std::string& name);

// Of what is trained.
long parameter_count(const Config& config);

}  // namespace vsplat
