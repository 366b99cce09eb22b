// Measures of the similarity of two pictures.
#pragma once
#include <cstdint>
#include <span>

#include "model/base/image.h"

namespace vsplat {

// Peak signal-to-noise ratio in dB for a peak of 1, over all channels; infinite for equal pictures, NaN if one contains
// NaN. Error(input) if the sizes differ or there is no pixel.
double psnr(const Image& a, const Image& b);

// psnr() over the known pixels after the affine map of colours that brings `drawn` nearest to `given` by the squared
// error over them, each value clamped to [0,1] after it: tells differences of exposure and white balance from others.
// The map has 3 x 3 factors and 3 offsets; where drawn colours do not determine it, as in a grey picture, it is the
// smallest one. `known` [H][W], 0 where a pixel is unknown; empty: all are known. NaN if a known pixel holds NaN, or
// none is known. Error(input) as for psnr(), and unless the pictures have 3 channels and `known` a value a pixel.
double psnr_cc(const Image& drawn, const Image& given, std::span<const std::uint8_t> known = {});

// The side of SSIM's window; SSIM is undefined for smaller pictures.
inline constexpr int ssim_window = 11;

// Structural similarity (Wang et al. 2004) for a peak of 1: Gaussian windows of 11 x 11 pixels, sigma 1.5, that lie
// completely inside the picture; K1 = 0.01, K2 = 0.03; mean over windows and channels. 1 for equal pictures, at least
// -1. NaN if a side is under 11 pixels. Error(input) as for psnr().
double ssim(const Image& a, const Image& b);

// |a - b|, value by value. Error(input) as for psnr().
Image absolute_difference(const Image& a, const Image& b);

}  // namespace vsplat
