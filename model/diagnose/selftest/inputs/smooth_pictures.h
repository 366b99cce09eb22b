// Pictures [n, h, w, 3] that are smooth, as photographs are, with flat white parts.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat::selftest {

inline std::vector<float> smooth_pictures(long n, long h, long w) {
  std::vector<float> out;
  for (long i = 0; i < n * h * w * 3; ++i) {
    const auto y = static_cast<float>(i / 3 / w % h), x = static_cast<float>(i / 3 % w);
    out.push_back(std::min(1.0f, 0.8f + 0.5f * std::sin(0.21f * x + static_cast<float>(i % 3)) * std::cos(0.13f * y)));
  }
  return out;
}

}  // namespace vsplat::selftest
