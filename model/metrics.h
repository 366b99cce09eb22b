// How well two pictures agree.
#pragma once
#include "model/image.h"

namespace vsplat {

// Peak signal-to-noise ratio in dB for a peak of 1, over all channels; infinite for equal pictures, NaN where one holds
// NaN. Error(input) where the sizes differ or there is no pixel.
double psnr(const Image& a, const Image& b);

}  // namespace vsplat
