// LayerNorm in double, from its definition.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// x [rows, c] -> [rows, c]
template <class T, class P>
std::vector<double> layernorm(const std::vector<T>& x, std::size_t c, const std::vector<P>& gamma,
                              const std::vector<P>& beta, double eps) {
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

struct LayerNormGradients {
  std::vector<double> x;            // [rows, c]
  std::vector<double> gamma, beta;  // [c]
};

// The gradient of sum(dy * layernorm(x)): through the mean and the variance separately.
template <class T>
LayerNormGradients layernorm_backward(const std::vector<T>& x, std::size_t c, const std::vector<float>& gamma,
                                      double eps, const std::vector<double>& dy) {
  LayerNormGradients out{std::vector<double>(x.size()), std::vector<double>(c), std::vector<double>(c)};
  const auto n = static_cast<double>(c);
  for (std::size_t r = 0; r < x.size(); r += c) {
    double mean = 0, variance = 0, by_variance = 0, by_mean = 0;
    for (std::size_t i = 0; i < c; ++i) mean += x[r + i] / n;
    for (std::size_t i = 0; i < c; ++i) variance += (x[r + i] - mean) * (x[r + i] - mean) / n;
    const double deviation = std::sqrt(variance + eps);
    for (std::size_t i = 0; i < c; ++i) {
      const double g = dy[r + i] * gamma[i];
      by_variance += g * (x[r + i] - mean) * -0.5 / (deviation * deviation * deviation);
      by_mean -= g / deviation;
      out.gamma[i] += dy[r + i] * (x[r + i] - mean) / deviation;
      out.beta[i] += dy[r + i];
    }
    for (std::size_t i = 0; i < c; ++i)
      out.x[r + i] = dy[r + i] * gamma[i] / deviation + by_variance * 2 * (x[r + i] - mean) / n + by_mean / n;
  }
  return out;
}

}  // namespace vsplat::ref
