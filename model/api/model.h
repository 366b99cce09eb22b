#pragma once
#include <memory>
#include <string>

#include "model/api/handle.h"
#include "model/networks/network.h"
#include "model/networks/params/any_config.h"
#include "model/networks/params/model_file.h"

struct vsplat_model_impl : vsplat::api::Counted {
  std::shared_ptr<const vsplat::AnyModel> file;
  vsplat_hash_state hash = VSPLAT_HASH_ABSENT;
  std::string path;  // of the file that it was read from; empty if not from a file
};

namespace vsplat::api {

// For calls that support only VS-Splat: Error(usage) names the other architecture.
const ModelFile& vsplat_file(vsplat_model model);
// The configuration of any architecture.
AnyConfig config_of(vsplat_model model);
const Weights& weights_of(vsplat_model model);

}  // namespace vsplat::api
