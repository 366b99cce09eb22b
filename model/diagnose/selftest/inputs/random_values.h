// Numbers that look random and are the same everywhere, by a seed; and gaps, where results are to come.
#pragma once
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

}  // namespace vsplat::selftest
