#pragma once
#include <memory>

#include "model/api/handle.h"
#include "model/genden/genden_model.h"
#include "model/genden/vsplat_genden_model.h"
#include "model/lara/lara_model.h"
#include "model/network/vsplat_model.h"
#include "model/params/model_file.h"

// One of them is there: by the network that the model is of.
struct vsplat_model_impl : vsplat::api::Counted {
  std::shared_ptr<const vsplat::ModelFile> file;
  std::shared_ptr<const vsplat::LaraModelFile> lara;
  std::shared_ptr<const vsplat::GendenModelFile> genden;
  std::shared_ptr<const vsplat::VsplatGendenModelFile> vsplat_genden;
  vsplat_hash_state hash = VSPLAT_HASH_ABSENT;
};

namespace vsplat::api {

// For what takes VS-Splat's network alone: Error(usage) names the other one.
const ModelFile& vsplat_file(vsplat_model model);
// Of any.
TakenViews taken_views(vsplat_model model);

// The network with these weights, uploaded and repacked at the first call for a model and kept with the device until
// another one is asked for.
const VsplatModel& model_on(vsplat_device device, vsplat_model model);
const LaraModel& lara_on(vsplat_device device, vsplat_model model);
const GendenModel& genden_on(vsplat_device device, vsplat_model model);
const VsplatGendenModel& vsplat_genden_on(vsplat_device device, vsplat_model model);

}  // namespace vsplat::api
