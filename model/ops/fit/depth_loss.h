// A loss on the depth of a drawn picture, where depth is given.
#pragma once
#include "model/ops/render/rasterize.h"

namespace vsplat {

// What a picture's given depth is.
enum class DepthKind {
  metric,    // camera z
  relative,  // camera z, but for an unknown scale and an unknown shift
  inverse    // 1 / camera z, but for an unknown scale and an unknown shift
};

// The loss is the mean, over pixels with a given depth, of
//   weight (alpha |log(expected depth) - log(given depth)| + 1 - alpha),
// where the first alpha is constant and the expected depth is depth / alpha: what is seen at a known depth is opaque.
// Unknown scales and shifts are those that fit the drawn depth best, and constant, too. Never waits for the device;
// every run gives the same bits.
struct DepthLoss {
  DevicePicture drawn;  // its depth and alpha
  Tensor given;         // f32 [H,W]; 0: unknown; if not metric, in [0, 1]
  DepthKind kind = DepthKind::metric;
  float weight = 0;
  double known = 0;  // number of pixels with a given depth
  Tensor ddepth;     // f32 [H,W], written
  Tensor dalpha;     // f32 [H,W], added to
};

void depth_loss(Context& ctx, const DepthLoss& a);

}  // namespace vsplat
