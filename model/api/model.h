#pragma once
#include <memory>

#include "model/api/handle.h"
#include "model/network/vsplat_model.h"
#include "model/params/model_file.h"

struct vsplat_model_impl : vsplat::api::Counted {
  std::shared_ptr<const vsplat::ModelFile> file;
  vsplat_hash_state hash = VSPLAT_HASH_ABSENT;
};

namespace vsplat::api {

// The network with these weights, uploaded and repacked at the first call for a model and kept with the device until
// another one is asked for.
const VsplatModel& model_on(vsplat_device device, vsplat_model model);

}  // namespace vsplat::api
