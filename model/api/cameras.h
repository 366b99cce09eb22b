#pragma once
#include <string>
#include <vector>

#include "model/api/handle.h"
#include "model/base/camera.h"
#include "model/io/views/view_set.h"

struct vsplat_cameras_impl : vsplat::api::Counted {
  std::vector<vsplat::Camera> cameras;  // drawn as pinholes: `distortion` is that of the listed picture
  vsplat::ViewSet listed;               // of a list: what it says of each camera; else without views

  const vsplat::Camera& at(std::size_t index) const {
    if (index >= cameras.size())
      vsplat::fail(vsplat::Status::usage, "there is no camera {}: {} in all", index, cameras.size());
    return cameras[index];
  }
};

namespace vsplat::api {

vsplat_camera describe(const Camera& camera);
// Checked: a picture's size, positive focal lengths, a rigid motion. `what` begins the message. Cameras to draw from
// have no lens.
Camera camera_of(const vsplat_camera& camera, const char* what, bool may_have_lens = false);

}  // namespace vsplat::api
