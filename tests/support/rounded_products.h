// Products of operands that are rounded to so many bits of significand, 8 (bfloat16) or 11 (TF32), and summed in
// floats.
#pragma once
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <vector>

#include "model/diagnose/selftest/inputs/random_values.h"

namespace vsplat::test {

// [m, k] times [n, k], transposed.
using Product =
    std::function<std::vector<float>(long m, long n, long k, const std::vector<float>& a, const std::vector<float>& w)>;

// Rounds to nearest, ties to even, by the definition: one of the two neighbours.
inline double rounded(double x, int bits) {
  if (x == 0 || !std::isfinite(x)) return x;
  int exponent = 0;
  std::frexp(x, &exponent);
  const double step = std::ldexp(1.0, std::max(exponent, -125) - bits);
  return std::nearbyint(x / step) * step;  // (ties to even is the default)
}

// |sum of rounded products - sum of products| <= (2 u + u^2) times the sum of the products' magnitudes, u = 2^-bits.
// Summing K products in floats adds at most K 2^-23 of that, however a unit rounds within a step.
inline void expect_within_the_bound(int bits, const std::vector<std::array<long, 3>>& sizes, const Product& product) {
  for (const auto& [m, n, k] : sizes) {
    SCOPED_TRACE(fmt::format("{} x {} x {}", m, n, k));
    const auto a = selftest::random_floats(selftest::size_of(m, k), 3),
               w = selftest::random_floats(selftest::size_of(n, k), 4);
    const auto got = product(m, n, k, a, w);
    const double u = std::ldexp(1.0, -bits), slack = static_cast<double>(k) * 0x1p-23;
    double error = 0;
    for (long i = 0; i < m; ++i)
      for (long j = 0; j < n; ++j) {
        double exact = 0, close = 0, sizes_sum = 0;
        for (long t = 0; t < k; ++t) {
          const double x = a[selftest::size_of(i * k + t)], y = w[selftest::size_of(j * k + t)];
          const double product_of_rounded = rounded(x, bits) * rounded(y, bits);
          exact += x * y, close += product_of_rounded, sizes_sum += std::abs(product_of_rounded);
        }
        const double is = got[selftest::size_of(i * n + j)];
        EXPECT_LE(std::abs(is - close), slack * sizes_sum);
        EXPECT_LE(std::abs(is - exact), (2 * u + u * u + 2 * slack) * sizes_sum);
        error = std::max(error, std::abs(is - exact));
      }
    EXPECT_GT(error, 0) << "nothing was rounded";
  }
}

// One term, and one column of 1: the result is the operand.
inline void expect_rounding_to_nearest_even(int bits, const Product& product) {
  std::vector<float> x = {0.0f, -0.0f, 1.0f, -1.0f, 3.14159265f, -2.7182818f, 1e-30f, 65504.0f, INFINITY, -INFINITY};
  for (std::uint32_t i = 0; i < 64; ++i)  // ties, and their neighbours
    for (const std::uint32_t off : {0xffffffffu, 0u, 1u}) {
      const float value = std::bit_cast<float>((127u << 23) + ((2 * i + 1) << (23 - bits)) + off);
      x.push_back(value), x.push_back(-value);
    }
  const auto more = selftest::random_floats(500, 5, -100, 100);
  x.insert(x.end(), more.begin(), more.end());
  const auto got = product(static_cast<long>(x.size()), 1, 1, x, {1.0f});
  for (std::size_t i = 0; i < x.size(); ++i)
    EXPECT_EQ(got[i], static_cast<float>(rounded(x[i], bits))) << fmt::format("{:a}", x[i]);
  for (const std::uint32_t nan : {0x7f800001u, 0x7fc00000u, 0xff80ffffu})  // whose set bits may all be dropped
    EXPECT_TRUE(std::isnan(product(1, 1, 1, {std::bit_cast<float>(nan)}, {1.0f})[0]));
}

}  // namespace vsplat::test
