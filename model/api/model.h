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
  std::string path;  // of the file that it was read from; empty: of none
};

namespace vsplat::api {

// For what takes VS-Splat's network alone: Error(usage) names the other one.
const ModelFile& vsplat_file(vsplat_model model);
// Of any.
AnyConfig config_of(vsplat_model model);
const Weights& weights_of(vsplat_model model);

}  // namespace vsplat::api
