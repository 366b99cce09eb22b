#pragma once
#include <memory>

#include "model/api/handle.h"
#include "model/input.h"

struct vsplat_views_impl : vsplat::api::Counted {
  vsplat::Photographs photographs;
};

struct vsplat_input_impl : vsplat::api::Counted {
  vsplat::Input input;
};
