// The list of what a model is made of, as model/params/network_layers.h declares it. Weight files, initial weights and
// the optimiser all go by it.
#pragma once
#include <vector>

#include "model/params/config_fields.h"
#include "model/params/parameter.h"

namespace vsplat {

// In the state dict's order. Names and shapes depend on sizes, `use_projected` and `refine_out_kernel`; every module
// exists for every value of `selection` and `levels`.
std::vector<Parameter> parameters(const Config& config);

// Of what is trained.
long parameter_count(const Config& config);

}  // namespace vsplat
