// Antialiased bicubic resampling of a square grid in double, as a sum over the whole grid.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// Keys' kernel with a = -0.5, in its own published form.
inline double keys_half(double x) {
  x = std::abs(x);
  if (x <= 1) return 1.5 * x * x * x - 2.5 * x * x + 1;
  if (x <= 2) return -0.5 * x * x * x + 2.5 * x * x - 4 * x + 2;
  return 0;
}

// grid [g, g, c] -> [t, t, c]
inline std::vector<double> resample(const std::vector<float>& grid, std::size_t g, std::size_t t, std::size_t c) {
  const double scale = static_cast<double>(g) / static_cast<double>(t), widen = std::max(scale, 1.0);
  const auto weight = [&](std::size_t to, std::size_t from) {
    const double centre = (static_cast<double>(to) + 0.5) * scale;
    return keys_half((static_cast<double>(from) + 0.5 - centre) / widen);
  };
  std::vector<double> out;
  for (std::size_t y = 0; y < t; ++y) {
    for (std::size_t x = 0; x < t; ++x) {
      for (std::size_t n = 0; n < c; ++n) {
        double sum = 0, total = 0;
        for (std::size_t j = 0; j < g; ++j) {
          for (std::size_t i = 0; i < g; ++i) {
            const double w = weight(y, j) * weight(x, i);
            sum += w * grid[(j * g + i) * c + n];
            total += w;
          }
        }
        out.push_back(sum / total);
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref
