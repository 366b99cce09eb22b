// LayerNorm in double, from its definition.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// x [rows, c] -> [rows, c]
template <class T>
std::vector<double> layernorm(const std::vector<T>& x, std::size_t c, const std::vector<float>& gamma,
                              const std::vector<float>& beta, double eps) {
  std::vector<double> y(x.size());
  for (std::size_t r = 0; r < x.size(); r += c) {
    double mean = 0, variance = 0;
    for (std::size_t i = 0; i < c; ++i) mean += x[r + i];
    mean /= static_cast<double>(c);
    for (std::size_t i = 0; i < c; ++i) variance += (x[r + i] - mean) * (x[r + i] - mean);
    variance /= static_cast<double>(c);
    for (std::size_t i = 0; i < c; ++i) y[r + i] = (x[r + i] - mean) / std::sqrt(variance + eps) * gamma[i] + beta[i];
  }
  return y;
}

}  // namespace vsplat::ref
