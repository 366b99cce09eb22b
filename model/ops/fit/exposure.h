// Applies a camera's exposure and colour balance to a picture, an affine map of the object's colours, with its
// derivative; see cl/fit/exposure.cl.
#pragma once
#include <array>

#include "model/ops/render/rasterize.h"

namespace vsplat {

struct ExposureForward {
  Tensor map;           // f32 [12]: a matrix row by row, then an offset
  DevicePicture drawn;  // over the background
  std::array<float, 3> background = {};
  Tensor out;  // f32 [H,W,3], written
};
void exposure_forward(Context& ctx, const ExposureForward& a);

struct ExposureBackward {
  Tensor map;
  DevicePicture drawn;
  std::array<float, 3> background = {};
  PictureGradient dpicture;  // colour: in: by `out`, out: by the drawn colour; alpha, if not none: added to
  Tensor dmap;               // f32 [12], written
};
void exposure_backward(Context& ctx, const ExposureBackward& a);

}  // namespace vsplat
