// Detects outliers: views whose picture disagrees with the others, for a wrong pose, other lighting or another object.
#pragma once
#include <cstddef>
#include <vector>

#include "model/fit/fitter.h"

namespace vsplat {

// Returns the outliers among pictures that a scene was fitted to, worst first: those with a PSNR more than 4 dB below
// the median, and more than 4 robust standard deviations below it (from the median absolute deviation, scaled as for a
// normal distribution). Returns none for fewer than five pictures.
std::vector<std::size_t> find_outliers(const std::vector<FitScore>& scores);

}  // namespace vsplat
