// The loss of training on pictures: the mean error, squared or absolute, + ssim_weight * (1 - SSIM), with its gradient.
// Forward and backward are one call: training needs both, and they share the largest buffers.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Pictures are clamped to [0, 1] first. SSIM has Gaussian windows of 11 x 11 with sigma 1.5 that lie inside the
// picture, K1 = 0.01 and K2 = 0.03; it is the mean over windows, channels and pictures. Where both sides exceed 160
// pixels it is MS-SSIM: five scales, each half the size of the last, with means over the windows for each picture and
// channel, where negative ones count as 0 (and so does their gradient). An absolute error of 0 has the slope 0. Uses
// scratch memory of about ten times the pictures, or twice without the similarity; one large picture with one scale is
// computed in bands, and takes that for a band. Never waits for the device; every run gives the same bits.
enum class ErrorKind { squared, absolute };
// automatic: SSIM or, if the picture is large enough, MS-SSIM. none: computes neither and ignores ssim_weight.
enum class SimilarityKind { automatic, single_scale, none };

struct PictureLoss {
  Tensor pictures;  // [N, H, W, 3], H and W from 11
  Tensor target;    // [N, H, W, 3], in [0, 1]
  float ssim_weight = 0.5f;
  Tensor out;        // [3]: the loss, the mean error, the similarity (0 if not computed)
  Tensor dpictures;  // [N, H, W, 3]: gradient by the pictures, 0 where those are outside of [0, 1]; none: not computed
  // Factor of dpictures: the gradient of a mean over several calls is the sum of theirs.
  float gradient_scale = 1;
  ErrorKind error = ErrorKind::squared;
  SimilarityKind similarity = SimilarityKind::automatic;
  long band_pixels = 1L << 20;  // about so many in a band
};

void picture_loss(Context& ctx, const PictureLoss& a);

}  // namespace vsplat
