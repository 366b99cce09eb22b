// Relocation of Gaussians as Markov chain Monte Carlo, in double and from the paper's formulas (Kheradmand et al.
// 2024); which sources are drawn, by walking the points one by one.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/base/rng.h"

namespace vsplat::ref {

// Equation 9: the opacity of each of n equal Gaussians that replace one.
inline double shared_opacity(double opacity, int n) { return -std::expm1(std::log1p(-opacity) / n); }

// And what its standard deviations are multiplied by: the double sum as it stands, binomials exact to 64 bits. Its
// terms cancel down to 1 - opacity of what they are.
inline double shared_scale(double opacity, int n) {
  const long double each = shared_opacity(opacity, n);
  long double sum = 0;
  for (int i = 1; i <= n; ++i) {
    long double term = each;  // binomial(i-1, k) (-1)^k each^(k+1)
    for (int k = 0; k < i; ++k) {
      sum += term / std::sqrt(static_cast<long double>(k + 1));
      term *= -each * static_cast<long double>(i - 1 - k) / static_cast<long double>(k + 1);
    }
  }
  return static_cast<double>(opacity / sum);
}

// The sources of N points at equal distances over a row of weights, the first at offset / N.
inline std::vector<std::size_t> systematic_sources(const std::vector<std::uint32_t>& weights, std::uint64_t points,
                                                   std::uint64_t offset) {
  std::uint64_t total = 0;
  for (const auto w : weights) total += w;
  std::vector<std::size_t> out;
  std::uint64_t end = weights[0];  // of the weight that stands at `at`
  std::size_t at = 0;
  for (std::uint64_t j = 0; j < points; ++j) {
    while ((j * total + offset) / points >= end) end += weights[++at];
    out.push_back(at);
  }
  return out;
}

// The offset of a draw, below the sum of weights.
inline std::uint64_t systematic_offset(std::uint64_t seed, std::uint32_t draw, std::uint64_t total) {
  return philox4x32_10({0, draw, stream_of("fit.relocation"), 0}, rng_key(seed))[0] * total >> 32;
}

using Matrix = std::array<std::array<double, 3>, 3>;

// R diag(exp(2 log scale)) R^T.
inline Matrix covariance(const std::array<double, 3>& log_scale, std::array<double, 4> q) {
  double length = 0;
  for (const double v : q) length += v * v;
  for (double& v : q) v /= std::sqrt(length);
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const Matrix r = {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                     {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                     {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
  Matrix out{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) out[i][j] += r[i][k] * std::exp(2 * log_scale[k]) * r[j][k];
  return out;
}

// How far a Gaussian wanders, as part of the rate.
inline double wandering(double opacity) { return 1 / (1 + std::exp(-100 * (0.005 - opacity))); }

// Three normal numbers of Gaussian k, by Box and Muller.
inline std::array<double, 3> normal_numbers(std::size_t k, std::uint64_t seed, std::uint32_t draw) {
  const auto bits = philox4x32_10({static_cast<std::uint32_t>(k), draw, stream_of("fit.noise"), 0}, rng_key(seed));
  const double r0 = std::sqrt(-2 * std::log(static_cast<double>(uniform_open(bits[0]))));
  const double r1 = std::sqrt(-2 * std::log(static_cast<double>(uniform_open(bits[2]))));
  const double a0 = 2 * M_PI * static_cast<double>(uniform01(bits[1])),
               a1 = 2 * M_PI * static_cast<double>(uniform01(bits[3]));
  return {r0 * std::cos(a0), r0 * std::sin(a0), r1 * std::cos(a1)};
}

}  // namespace vsplat::ref
