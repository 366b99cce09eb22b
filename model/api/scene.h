#pragma once
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "model/api/handle.h"
#include "model/base/scene.h"
#include "model/io/ply.h"

namespace vsplat::api {

// A direction of the C interface, of any length, as scenes hold it; none for 0, 0, 0. `what` names it in the error.
std::optional<std::array<float, 3>> up_of(const double (&up)[3], const char* what);

// To the caller's arrays that are not null, each with room for all of them. A surfel's third scale is 0.
void copy_out(const Gaussians& from, const vsplat_gaussians& to);

}  // namespace vsplat::api

struct vsplat_scene_impl : vsplat::api::Counted {
  std::shared_ptr<const vsplat::Scene> scene;
  std::vector<int> selected;  // voxels, ascending
  vsplat::SkippedGaussians skipped;
};
