#pragma once
#include <vector>

#include "model/api/handle.h"
#include "model/camera.h"

struct vsplat_cameras_impl : vsplat::api::Counted {
  std::vector<vsplat::Camera> cameras;
};

namespace vsplat::api {

vsplat_camera describe(const Camera& camera);
// Checked: a picture's size, positive focal lengths, a rigid motion. `what` begins the message.
Camera camera_of(const vsplat_camera& camera, const char* what);

}  // namespace vsplat::api
