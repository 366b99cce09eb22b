// A model in memory: its configuration, its weights, and its file's metadata.
#pragma once
#include <map>
#include <string>

#include "model/networks/params/config_fields.h"
#include "model/networks/params/genden_config.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/vsplat_genden_config.h"
#include "model/networks/params/weights.h"

namespace vsplat {

template <class Configuration>
struct ModelOf {
  Configuration config;
  Weights weights;
  std::map<std::string, std::string> metadata;  // as in the file, including config, sha256 and provenance
};

using ModelFile = ModelOf<Config>;
using LaraModelFile = ModelOf<LaraConfig>;
using GendenModelFile = ModelOf<GendenConfig>;
using VsplatGendenModelFile = ModelOf<VsplatGendenConfig>;

}  // namespace vsplat
