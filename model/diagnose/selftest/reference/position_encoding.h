// Sines and cosines of positions, in double, from the definition.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// x, then sin(2^i x), cos(2^i x), i = 0..9, three values each: 63 numbers for the three of a point.
template <class T>
std::vector<double> position_encoding(const std::vector<T>& points) {
  std::vector<double> out;
  for (std::size_t p = 0; p < points.size(); p += 3) {
    for (std::size_t i = 0; i < 3; ++i) out.push_back(points[p + i]);
    for (int band = 0; band < 10; ++band) {
      const double f = 1 << band;
      for (std::size_t i = 0; i < 3; ++i) out.push_back(std::sin(f * points[p + i]));
      for (std::size_t i = 0; i < 3; ++i) out.push_back(std::cos(f * points[p + i]));
    }
  }
  return out;
}

// By the points, for a loss whose derivative by the encoding is dout [P, 63].
template <class T>
std::vector<double> position_encoding_backward(const std::vector<T>& points, const std::vector<float>& dout) {
  std::vector<double> by_points;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* from = &dout[i / 3 * 63 + i % 3];
    double sum = from[0];
    for (int band = 0; band < 10; ++band) {
      const double f = 1 << band;
      sum += f * (std::cos(f * points[i]) * from[3 + 6 * band] - std::sin(f * points[i]) * from[6 + 6 * band]);
    }
    by_points.push_back(sum);
  }
  return by_points;
}

}  // namespace vsplat::ref
