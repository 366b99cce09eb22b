// The fields of a configuration that the shapes of a network's tensors tell.
#pragma once
#include <string>
#include <vector>

#include "model/io/torch_file.h"
#include "model/params/config.h"

namespace vsplat {

// Of those that they do not tell, these have no value that goes without saying; the others are choices, for which the
// published code's stand.
inline const std::vector<std::string> untold_fields = {"vit_heads", "groups", "image", "volume"};

struct DeducedConfig {
  Config config;                    // all else as it is in an empty one
  std::vector<std::string> fields;  // those that were told
};

// From the tensors below `prefix`. Error(format) that names the tensor which is missing or of no VS-Splat's shape.
DeducedConfig deduced_config(const TorchFile& file, const std::string& prefix);

}  // namespace vsplat
