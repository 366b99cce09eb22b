#pragma once
#include <memory>

#include "model/api/handle.h"
#include "model/model_file.h"

struct vsplat_model_impl : vsplat::api::Counted {
  std::shared_ptr<const vsplat::ModelFile> file;
  vsplat_hash_state hash = VSPLAT_HASH_ABSENT;
};
