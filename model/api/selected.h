#pragma once
#include "model/networks/params/any_config.h"

namespace vsplat::api {

// Converts a caller's share into a count of what the network selects from, voxels or primitives, rounded down. All such
// conversions go through here. `asked` 0: `usual`. Error(usage), naming `what`, if it is not a share.
long selected_of(double asked, double usual, const AnyConfig& config, const char* what);

}  // namespace vsplat::api
