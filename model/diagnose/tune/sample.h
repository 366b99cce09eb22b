// Random numbers for trials, and errors on samples of their results.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace vsplat::tuning {

// Pseudorandom numbers in [-1, 1), cheap enough for hundreds of millions.
inline std::vector<float> numbers(long count, std::uint32_t seed) {
  std::vector<float> out(static_cast<std::size_t>(count));
  std::uint32_t state = seed * 2654435761u + 1;
  for (float& v : out) {
    state = state * 1664525u + 1013904223u;
    v = static_cast<float>(state >> 8) * 0x1p-23f - 1.0f;
  }
  return out;
}

// Largest |got - want| so far relative to the largest |want|; infinite once a value is not finite.
class WorstError {
 public:
  void add(double got, double want) {
    const double error = std::abs(got - want);
    worst_ = std::max(worst_, std::isfinite(error) ? error : INFINITY);
    largest_ = std::max(largest_, std::abs(want));
  }
  double of_largest() const { return largest_ > 0 ? worst_ / largest_ : INFINITY; }

 private:
  double worst_ = 0, largest_ = 0;
};

// Indices below `count`: the last ones, where tiles fail most often, and others.
inline std::vector<long> sampled(long count, int samples) {
  std::mt19937_64 engine(1);
  std::vector<long> out;
  out.reserve(static_cast<std::size_t>(std::max(samples, 0)));
  for (int s = 0; s < samples; ++s)
    out.push_back(s < 4 ? std::max(0L, count - 1 - s)
                        : static_cast<long>(engine() % static_cast<std::uint64_t>(count)));
  return out;
}

}  // namespace vsplat::tuning
