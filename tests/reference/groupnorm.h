// GroupNorm over all rows in double, from its definition.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// x [n,c] (already concatenated) -> normalised x, times gamma plus beta.
inline std::vector<double> groupnorm(const std::vector<float>& x, std::size_t n, std::size_t c, std::size_t groups,
                                     const std::vector<float>& gamma, const std::vector<float>& beta, double eps) {
  std::vector<double> y(n * c);
  const std::size_t size = c / groups;
  for (std::size_t g = 0; g < groups; ++g) {
    double mean = 0, variance = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = g * size; k < (g + 1) * size; ++k) mean += x[i * c + k];
    }
    mean /= static_cast<double>(n * size);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = g * size; k < (g + 1) * size; ++k) variance += (x[i * c + k] - mean) * (x[i * c + k] - mean);
    }
    variance /= static_cast<double>(n * size);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = g * size; k < (g + 1) * size; ++k) {
        y[i * c + k] = (x[i * c + k] - mean) / std::sqrt(variance + eps) * gamma[k] + beta[k];
      }
    }
  }
  return y;
}

}  // namespace vsplat::ref
