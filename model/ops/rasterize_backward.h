// Blending's derivative: what a picture's gradient says of each Gaussian in each tile.
#pragma once
#include <array>

#include "model/ops/rasterize.h"

namespace vsplat {

// A loss's derivatives by a picture, of which any may be none: zeros.
struct PictureGradient {
  Tensor colour;  // f32 [H,W,3]
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]
};

// A row per intersection of a tile and a Gaussian, where Binned::slots puts it. See cl/rasterize_backward.cl for the
// columns.
struct IntersectionGradients {
  Tensor rows;     // f32 [N,10]
  Tensor touched;  // u8 [N]: 1 where a row was written; the others are zeros, and not written
};

// For a part of the picture, of which `picture` is what rasterize() made over the same background; `binned` has slots.
IntersectionGradients rasterize_backward(Context& ctx, const Projected& projected, const Binned& binned,
                                         const Part& part, const DevicePicture& picture,
                                         const PictureGradient& gradient, const std::array<float, 3>& background);

}  // namespace vsplat
