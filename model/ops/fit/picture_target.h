// What a drawn picture should have been, over the background it was drawn over, and a loss on its alpha.
#pragma once
#include <array>

#include "model/ops/render/rasterize.h"

namespace vsplat {

// Where nothing is known of a pixel, the target is what was drawn, within [0, 1]: no loss. The alpha's loss is the mean
// absolute error times alpha_weight; differences below half a step of 8 bits are none.
struct PictureTarget {
  Tensor given;  // u8 [H,W,4]: colour premultiplied by alpha, alpha
  Tensor known;  // u8 [H,W]: 0 where nothing is known; none: all is
  std::array<float, 3> background = {};
  DevicePicture drawn;  // over the background
  float alpha_weight = 0;
  Tensor target;  // f32 [H,W,3], written
  Tensor dalpha;  // f32 [H,W], written: the alpha's loss by the alpha; none: not wanted
};

void picture_target(Context& ctx, const PictureTarget& a);

}  // namespace vsplat
