// The list of a model's parameters, as declared in network_layers.h, lara_layers.h and densify_layers.h. Weight files,
// initial weights and the optimiser use it.
#pragma once
#include <vector>

#include "model/networks/params/config_fields.h"
#include "model/networks/params/genden_config.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/parameter.h"
#include "model/networks/params/vsplat_genden_config.h"

namespace vsplat {

// In the state dict's order. Names and shapes depend on sizes, `use_projected` and `refine_out_kernel`; every module
// exists for all values of `selection` and `levels`.
std::vector<Parameter> parameters(const Config& config);
// Those of the published state dict, without its unused buffers.
std::vector<Parameter> parameters(const LaraConfig& config);
std::vector<Parameter> parameters(const GendenConfig& config);
std::vector<Parameter> parameters(const VsplatGendenConfig& config);

}  // namespace vsplat
