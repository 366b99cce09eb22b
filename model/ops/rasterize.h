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

DevicePicture rasterize(Context& ctx, const Projected& projected, const Binned& binned, int width, int height,
                        const std::array<float, 3>& background);

}  // namespace vsplat
