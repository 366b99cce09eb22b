// The target of a drawn picture, over the background that it was drawn over, and a loss on its alpha.
#pragma once
#include <array>

#include "model/ops/render/rasterize.h"

namespace vsplat {

// For masked pixels the target is the drawn colour, clamped to [0, 1]: no loss. The alpha's loss is the mean absolute
// error times alpha_weight; differences below half a step of 8 bits count as 0.
struct PictureTarget {
  Tensor given;  // u8 [H,W,4]: colour premultiplied by alpha, alpha
  Tensor known;  // u8 [H,W]: the mask, 0 where nothing is known; none: everything is known
  std::array<float, 3> background = {};
  DevicePicture drawn;  // over the background
  float alpha_weight = 0;
  Tensor target;  // f32 [H,W,3], written
  Tensor dalpha;  // f32 [H,W], written: gradient of the alpha's loss; none: not computed
};

void picture_target(Context& ctx, const PictureTarget& a);

}  // namespace vsplat
