#include "runtime/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace vsplat {
namespace {

// By the format's definition: sign, 5 bits of exponent with bias 15, 10 of fraction.
double value_of(unsigned half) {
  const int exponent = static_cast<int>(half >> 10 & 31u);
  const double fraction = half & 1023u;
  const double magnitude = exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1 + fraction / 1024, exponent - 15);
  return half & 0x8000u ? -magnitude : magnitude;
}

constexpr unsigned kInfinity = 0x7c00;

TEST(Half, EveryFiniteOneIsExactAndComesBack) {
  for (unsigned sign : {0u, 0x8000u})
    for (unsigned bits = 0; bits < kInfinity; ++bits) {
      const auto half = static_cast<std::uint16_t>(sign | bits);
      const float value = from_half(half);
      ASSERT_EQ(static_cast<double>(value), value_of(half)) << half;
      ASSERT_EQ(std::signbit(value), sign != 0) << half;
      ASSERT_EQ(to_half(value), half) << value;
    }
}

TEST(Half, BetweenTwoTheNearerIsTakenAndHalfwayTheEvenOne) {
  for (unsigned sign : {0u, 0x8000u})
    for (unsigned bits = 0; bits + 1 < kInfinity; ++bits) {
      const unsigned below = sign | bits, above = sign | (bits + 1);
      // Exact, since a float has enough bits.
      const auto middle = static_cast<float>((value_of(below) + value_of(above)) / 2);
      ASSERT_EQ(to_half(middle), bits % 2 == 0 ? below : above) << middle;
      ASSERT_EQ(to_half(std::nextafter(middle, 0.0f)), below) << middle;
      const float away = std::nextafter(middle, sign ? -1e9f : 1e9f);
      ASSERT_EQ(to_half(away), above) << middle;
    }
}

TEST(Half, BeyondTheLargestIsInfinity) {
  constexpr float kFirst = 65520;
  EXPECT_EQ(from_half(0x7bff), kLargestHalf);
  EXPECT_EQ(to_half(std::nextafter(kFirst, 0.0f)), 0x7bff);
  for (const float value : {kFirst, 1e6f, std::numeric_limits<float>::max(), std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(to_half(value), 0x7c00) << value;
    EXPECT_EQ(to_half(-value), 0xfc00) << value;
  }
  EXPECT_EQ(from_half(0x7c00), std::numeric_limits<float>::infinity());
  EXPECT_EQ(from_half(0xfc00), -std::numeric_limits<float>::infinity());
}

TEST(Half, NotANumberStaysOne) {
  EXPECT_TRUE(std::isnan(from_half(to_half(std::numeric_limits<float>::quiet_NaN()))));
  // A NaN whose payload would be cut to zero, which would make it infinity.
  EXPECT_TRUE(std::isnan(from_half(to_half(std::bit_cast<float>(0x7f800001u)))));
  EXPECT_TRUE(std::isnan(from_half(0x7c01)));
}

TEST(Half, WhatIsTooSmallIsZeroOfItsSign) {
  EXPECT_EQ(to_half(1e-30f), 0);
  EXPECT_EQ(to_half(-1e-30f), 0x8000);
  EXPECT_EQ(to_half(std::numeric_limits<float>::denorm_min()), 0);
}

}  // namespace
}  // namespace vsplat
