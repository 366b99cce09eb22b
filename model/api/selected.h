#pragma once
#include "model/networks/params/any_config.h"

namespace vsplat::api {

// How many of what the network selects from, voxels or primitives, a caller's share of them is, rounded down: the one
// place where shares become counts.
// `asked` 0: `usual`. Error(usage) names `what` where it is no share.
long selected_of(double asked, double usual, const AnyConfig& config, const char* what);

}  // namespace vsplat::api
