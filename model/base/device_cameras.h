// Cameras of the input views in the layout of the network's kernels, in the object's frame (the cube [-0.5,0.5]^3).
#pragma once
#include <vector>

#include "model/base/camera.h"
#include "runtime/context.h"

namespace vsplat {

struct DeviceCameras {
  Tensor c2w;         // f32 [V,4,4] row-major
  Tensor w2c;         // f32 [V,4,4]
  Tensor intrinsics;  // f32 [V,4]: fx, fy, cx, cy in pixels of the full picture

  long count() const { return intrinsics ? intrinsics.dim(0) : 0; }
};

DeviceCameras upload_cameras(Context& ctx, const std::vector<Camera>& cameras);

}  // namespace vsplat
