// The fields of a configuration that the shapes of a network's tensors tell.
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
  Configuration config;             // all else as it is in an empty one
  std::vector<std::string> fields;  // those that were told
  std::vector<std::string> untold;  // of the others, those that have no value which goes without saying
  std::vector<std::string> kinds;   // of those told, the ones that name a part's kind: every named configuration has it
};
using DeducedConfig = Deduced<Config>;
using DeducedLaraConfig = Deduced<LaraConfig>;
using DeducedGendenConfig = Deduced<GendenConfig>;
using DeducedVsplatGendenConfig = Deduced<VsplatGendenConfig>;

// From the tensors below `prefix`. Error(format) that names the tensor which is missing or of no such network's shape.
DeducedConfig deduced_config(const TorchFile& file, const std::string& prefix);
DeducedLaraConfig deduced_lara_config(const TorchFile& file, const std::string& prefix);
// Whether the model is the residual one no shape tells: as the file has it whose heads come before its masks.
DeducedGendenConfig deduced_genden_config(const TorchFile& file, const std::string& prefix);
DeducedVsplatGendenConfig deduced_vsplat_genden_config(const TorchFile& file, const std::string& prefix);

}  // namespace vsplat
