// Pictures that the others disagree with: a wrong pose, another lighting, another object.
#pragma once
#include <cstddef>
#include <vector>

#include "model/fit/fitter.h"

namespace vsplat {

// Of pictures that a scene was fitted to, those that it agrees with far less than with the others, worst first: by
// their PSNR more than 4 dB below the median, and more than 4 of its deviations (the median one, as a normal
// distribution has it). None of fewer than five.
std::vector<std::size_t> outliers(const std::vector<FitScore>& scores);

}  // namespace vsplat
