// Blending of binned surfels, near to far: rasterize.h for surfels.
#pragma once
#include "model/ops/render/project_surfels.h"
#include "model/ops/render/rasterize.h"

namespace vsplat {

// Draws a part of the picture, with those maps that have a tensor.
struct RasterizeSurfelsForward {
  Projected projected;
  Binned binned;
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // the part is written
  float near = 0.2f;      // least camera z at which rays meet surfels
  SurfelRevision revision = SurfelRevision::lara;
};
void rasterize_surfels_forward(Context& ctx, const RasterizeSurfelsForward& a);

// The maps for which `dpicture` has gradients must be given; for distortion the moments, too. Median depths have no
// gradient.
struct RasterizeSurfelsBackward {
  Projected projected;
  Binned binned;  // with slots
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // from the forward
  PictureGradient dpicture;
  float near = 0.2f;
  SurfelRevision revision = SurfelRevision::lara;
};
IntersectionGradients rasterize_surfels_backward(Context& ctx, const RasterizeSurfelsBackward& a);

}  // namespace vsplat
