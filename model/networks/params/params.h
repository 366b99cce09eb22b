// The list of what a model is made of, as network_layers.h, lara_layers.h and densify_layers.h declare it. Weight
// files, initial weights and the optimiser all go by it.
#pragma once
#include <vector>

#include "model/networks/params/config_fields.h"
#include "model/networks/params/genden_config.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/parameter.h"
#include "model/networks/params/vsplat_genden_config.h"

namespace vsplat {

// In the state dict's order. Names and shapes depend on sizes, `use_projected` and `refine_out_kernel`; every module
// exists for every value of `selection` and `levels`.
std::vector<Parameter> parameters(const Config& config);
// The published state dict's, but for its buffers, which nothing reads.
std::vector<Parameter> parameters(const LaraConfig& config);
std::vector<Parameter> parameters(const GendenConfig& config);
std::vector<Parameter> parameters(const VsplatGendenConfig& config);

// Of what is trained.
long parameter_count(const Config& config);
long parameter_count(const LaraConfig& config);
long parameter_count(const GendenConfig& config);
long parameter_count(const VsplatGendenConfig& config);

}  // namespace vsplat
