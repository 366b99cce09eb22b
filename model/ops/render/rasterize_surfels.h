// Blending of binned surfels, near to far: as rasterize.h has it for volumes.
#pragma once
#include "model/ops/render/project_surfels.h"
#include "model/ops/render/rasterize.h"

namespace vsplat {

// Draws a part of the picture, with what of the maps there is a tensor for.
struct RasterizeSurfelsForward {
  Projected projected;
  Binned binned;
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // the part is written
  float near = 0.2f;      // camera z from which on rays meet surfels
  SurfelRevision revision = SurfelRevision::lara;
};
void rasterize_surfels_forward(Context& ctx, const RasterizeSurfelsForward& a);

// The maps that `dpicture` has gradients of must be there, of distortion the moments, too. Median depths have none.
struct RasterizeSurfelsBackward {
  Projected projected;
  Binned binned;  // with slots
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // as the forward made it
  PictureGradient dpicture;
  float near = 0.2f;
  SurfelRevision revision = SurfelRevision::lara;
};
IntersectionGradients rasterize_surfels_backward(Context& ctx, const RasterizeSurfelsBackward& a);

}  // namespace vsplat
