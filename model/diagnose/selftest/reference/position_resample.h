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

// How much output `to` of t draws on position `from` of g, but for a factor that is the output's.
inline double resample_weight(std::size_t to, std::size_t from, std::size_t g, std::size_t t) {
  const double scale = static_cast<double>(g) / static_cast<double>(t), widen = std::max(scale, 1.0);
  const double centre = (static_cast<double>(to) + 0.5) * scale;
  return keys_half((static_cast<double>(from) + 0.5 - centre) / widen);
}

// grid [g, g, c] -> [t, t, c]
template <class F>
std::vector<double> resample(const std::vector<F>& grid, std::size_t g, std::size_t t, std::size_t c) {
  const auto weight = [&](std::size_t to, std::size_t from) { return resample_weight(to, from, g, t); };
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

// dout [t, t, c], of sum(dout * resample(grid)) -> [g, g, c]
inline std::vector<double> resample_backward(const std::vector<double>& dout, std::size_t g, std::size_t t,
                                             std::size_t c) {
  std::vector<double> out(g * g * c);
  for (std::size_t y = 0; y < t; ++y) {
    for (std::size_t x = 0; x < t; ++x) {
      double total = 0;
      for (std::size_t j = 0; j < g; ++j)
        for (std::size_t i = 0; i < g; ++i) total += resample_weight(y, j, g, t) * resample_weight(x, i, g, t);
      for (std::size_t j = 0; j < g; ++j)
        for (std::size_t i = 0; i < g; ++i)
          for (std::size_t n = 0; n < c; ++n)
            out[(j * g + i) * c + n] +=
                resample_weight(y, j, g, t) * resample_weight(x, i, g, t) / total * dout[(y * t + x) * c + n];
    }
  }
  return out;
}

}  // namespace vsplat::ref
