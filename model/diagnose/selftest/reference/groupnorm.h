// GroupNorm over all rows in double, from its definition.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// x [n,c] (already concatenated) -> normalised x, times gamma plus beta.
template <class T>
std::vector<double> groupnorm(const std::vector<T>& x, std::size_t n, std::size_t c, std::size_t groups,
                              const std::vector<T>& gamma, const std::vector<T>& beta, double eps) {
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

struct GroupNormGradient {
  std::vector<double> dx, dgamma, dbeta;
};

// The gradient through y = silu(groupnorm(x)), for a loss whose derivative by y is dy [n,c].
template <class T>
GroupNormGradient groupnorm_backward(const std::vector<T>& x, std::size_t n, std::size_t c, std::size_t groups,
                                     const std::vector<T>& gamma, const std::vector<T>& beta, double eps,
                                     const std::vector<T>& dy) {
  const std::vector<double> z = groupnorm(x, n, c, groups, gamma, beta, eps);
  const std::vector<double> u =
      groupnorm(x, n, c, groups, std::vector<T>(c, T(1)), std::vector<T>(c, T(0)), eps);  // normalised
  GroupNormGradient g{std::vector<double>(n * c), std::vector<double>(c), std::vector<double>(c)};
  std::vector<double> du(n * c);
  for (std::size_t i = 0; i < n * c; ++i) {
    const double s = 1 / (1 + std::exp(-z[i])), dz = dy[i] * (s + z[i] * s * (1 - s));
    g.dbeta[i % c] += dz;
    g.dgamma[i % c] += dz * u[i];
    du[i] = dz * gamma[i % c];
  }
  const std::size_t size = c / groups;
  for (std::size_t group = 0; group < groups; ++group) {
    const auto each = [&](const auto& visit) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = group * size; k < (group + 1) * size; ++k) visit(i * c + k);
    };
    const auto count = static_cast<double>(n * size);
    double mean = 0, variance = 0, sum = 0, sum_u = 0;
    each([&](std::size_t i) { mean += x[i] / count; });
    each([&](std::size_t i) { variance += (x[i] - mean) * (x[i] - mean) / count; });
    each([&](std::size_t i) { sum += du[i], sum_u += du[i] * u[i]; });
    each([&](std::size_t i) { g.dx[i] = (du[i] - sum / count - u[i] * sum_u / count) / std::sqrt(variance + eps); });
  }
  return g;
}

}  // namespace vsplat::ref
