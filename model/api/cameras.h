#pragma once
#include <string>
#include <vector>

#include "model/api/handle.h"
#include "model/base/camera.h"
#include "model/io/views/view_set.h"

struct vsplat_cameras_impl : vsplat::api::Counted {
  std::vector<vsplat::Camera> cameras;  // used as pinholes: `distortion` is that of the listed picture
  vsplat::ViewSet listed;               // for cameras from a list: what it says about each; else it has no views

  const vsplat::Camera& at(std::size_t index) const {
    if (index >= cameras.size())
      vsplat::fail(vsplat::Status::usage, "there is no camera {}: {} in all", index, cameras.size());
    return cameras[index];
  }
};

namespace vsplat::api {

vsplat_camera describe(const Camera& camera);
// Converts and checks a camera: picture size, positive focal lengths, a rigid transform. `what` begins error messages.
// Without `may_have_lens`, Error(usage) for a camera with a lens: pictures are drawn as a pinhole sees them.
Camera camera_of(const vsplat_camera& camera, const char* what, bool may_have_lens = false);

}  // namespace vsplat::api
