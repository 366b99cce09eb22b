// Numbers that look random and are the same everywhere, by a seed; and gaps, where results are to come.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace vsplat::selftest {

inline std::vector<float> random_floats(std::size_t count, std::uint32_t seed, float low = -1.0f, float high = 1.0f) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform(low, high);
  std::vector<float> out(count);
  for (float& v : out) v = uniform(engine);
  return out;
}

inline std::vector<double> as_doubles(const std::vector<float>& x) { return {x.begin(), x.end()}; }
inline std::vector<float> as_floats(const std::vector<double>& x) { return {x.begin(), x.end()}; }

// The same numbers.
inline std::vector<double> random_doubles(std::size_t count, std::uint32_t seed, float low = -1.0f, float high = 1.0f) {
  return as_doubles(random_floats(count, seed, low, high));
}

inline std::vector<float> nans(std::size_t count) {
  return std::vector<float>(count, std::numeric_limits<float>::quiet_NaN());
}

// a * b numbers.
inline std::size_t size_of(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

// Sums that are added to what was there.
inline std::vector<double> plus(std::vector<double> sums, const std::vector<float>& before) {
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
  return sums;
}

// A background of unequal channels.
inline constexpr std::array<float, 3> kBehindPictures = {0.2f, 0.9f, 0.5f};

}  // namespace vsplat::selftest
