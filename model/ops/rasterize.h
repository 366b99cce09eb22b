// Blending of binned Gaussians, near to far.
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
void rasterize(Context& ctx, const Projected& projected, const Binned& binned, const Part& part,
               const std::array<float, 3>& background, const DevicePicture& picture);

}  // namespace vsplat
