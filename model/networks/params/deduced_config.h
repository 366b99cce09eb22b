// Deduces a configuration's fields from the shapes of a network's tensors.
#pragma once
#include <string>
#include <vector>

#include "model/io/archive/torch_file.h"
#include "model/networks/params/config.h"
#include "model/networks/params/genden_config.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/vsplat_genden_config.h"

namespace vsplat {

template <class Configuration>
struct Deduced {
  Configuration config;              // other fields as in an empty configuration
  std::vector<std::string> fields;   // fields that were deduced
  std::vector<std::string> unknown;  // other fields that have no default value to assume
  std::vector<std::string> kinds;    // deduced fields that name a component's kind: every named configuration has them
};
using DeducedConfig = Deduced<Config>;
using DeducedLaraConfig = Deduced<LaraConfig>;
using DeducedGendenConfig = Deduced<GendenConfig>;
using DeducedVsplatGendenConfig = Deduced<VsplatGendenConfig>;

// From the tensors below `prefix`. Error(format) names a tensor that is missing or has an impossible shape.
DeducedConfig deduced_config(const TorchFile& file, const std::string& prefix);
DeducedLaraConfig deduced_lara_config(const TorchFile& file, const std::string& prefix);
// No shape shows whether the model is the residual one: it is if the file lists the heads before the masks.
DeducedGendenConfig deduced_genden_config(const TorchFile& file, const std::string& prefix);
DeducedVsplatGendenConfig deduced_vsplat_genden_config(const TorchFile& file, const std::string& prefix);

}  // namespace vsplat
