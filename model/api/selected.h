#pragma once
#include "model/params/config.h"
#include "model/params/lara_config.h"

namespace vsplat::api {

// How many of the model's voxels a caller's share of them is, rounded down: the one place where shares become counts.
// `asked` 0: `usual`. Error(usage) names `what` where it is no share.
long voxels_of(double asked, double usual, const Config& config, const char* what);
// The same of LaRa's primitives.
long primitives_of(double asked, double usual, const LaraConfig& config, const char* what);

}  // namespace vsplat::api
