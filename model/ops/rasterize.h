// Blending of binned Gaussians, near to far; and its derivative.
#pragma once
#include <array>

#include "model/ops/tile_bin.h"

namespace vsplat {

struct DevicePicture {
  Tensor colour;  // f32 [H,W,3], over the background
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]: sum of weight x camera z
};

DevicePicture make_picture(Context& ctx, int width, int height);

// Draws a part of the picture.
struct RasterizeForward {
  Projected projected;
  Binned binned;
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // the part is written
};
void rasterize_forward(Context& ctx, const RasterizeForward& a);

// A loss's derivatives by a picture, of which any may be none: zeros.
struct PictureGradient {
  Tensor colour;  // f32 [H,W,3]
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]
};

struct RasterizeBackward {
  Projected projected;
  Binned binned;  // with slots
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // as the forward made it
  PictureGradient dpicture;
};
IntersectionGradients rasterize_backward(Context& ctx, const RasterizeBackward& a);

}  // namespace vsplat
