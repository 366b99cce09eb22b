#pragma once
#include <memory>

#include "model/api/handle.h"
#include "model/input/input.h"

namespace vsplat::api {

// What options structs have in common. Error(usage) for values that are none.
Fit fit_of(const vsplat_fit& fit);
PlacementRequest placement_of(bool has_centre, const double (&centre)[3], double edge, bool auto_frame);

}  // namespace vsplat::api

struct vsplat_views_impl : vsplat::api::Counted {
  vsplat::Photographs photographs;
};

struct vsplat_input_impl : vsplat::api::Counted {
  vsplat::Input input;
};
