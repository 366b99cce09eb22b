#include "model/api/selected.h"

#include "runtime/fail.h"

namespace vsplat::api {

namespace {

long share_of(double asked, double usual, long all, const char* what) {
  if (!(asked >= 0 && asked <= 1))
    fail(Status::usage, "{} is {}: a share of the voxels, 0 to 1, is expected", what, asked);
  return static_cast<long>((asked > 0 ? asked : usual) * static_cast<double>(all));
}

}  // namespace

long voxels_of(double asked, double usual, const Config& config, const char* what) {
  return share_of(asked, usual, config.voxels(), what);
}

long primitives_of(double asked, double usual, const LaraConfig& config, const char* what) {
  return share_of(asked, usual, config.most_primitives(), what);
}

}  // namespace vsplat::api
