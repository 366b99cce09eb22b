// How a picture of a difference shows it.
#pragma once
#include <algorithm>
#include <cmath>

namespace command {

// 4 x |a - b|, colours in [0,1]; without the factor, differences that the eye sees in the pictures would look black.
inline float shown_difference(float a, float b) {
  return std::min(4 * std::abs(std::clamp(a, 0.0f, 1.0f) - std::clamp(b, 0.0f, 1.0f)), 1.0f);
}

}  // namespace command
