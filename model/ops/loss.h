// The loss of a training on pictures: the mean squared error + ssim_weight * (1 - SSIM), with its gradient:
// forward and backward in one, since training wants both and they share what takes the most memory.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Pictures are clamped to [0, 1] first. SSIM has Gaussian windows of 11 x 11, sigma 1.5, that lie inside, K1 = 0.01, K2
// = 0.03, the mean over windows, channels and pictures. Where both sides exceed 160 pixels it is MS-SSIM: five scales,
// each half the last, means over windows by picture and channel, negative ones as 0 (whose gradient is 0, too). Takes
// memory for about ten times the pictures while it runs. Never waits; the same bits each run.
struct PictureLoss {
  Tensor pictures;  // [N, H, W, 3], H and W from 11
  Tensor target;    // [N, H, W, 3], in [0, 1]
  float ssim_weight = 0.5f;
  Tensor out;        // [3]: the loss, the mean squared error, the similarity
  Tensor dpictures;  // [N, H, W, 3]: the loss by the pictures, 0 where those are outside of [0, 1]; none: not computed
  // dpictures is multiplied by this: the gradient of a mean over several calls is the sum of theirs.
  float gradient_scale = 1;
};

void picture_loss(Context& ctx, const PictureLoss& a);

}  // namespace vsplat
