// Random data for the cases, and sampled checks.
#pragma once
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace vsplat::bench {

// Numbers in [low, high) that look random, and are cheap to make by the hundred million.
inline std::vector<float> random_floats(long count, std::uint32_t seed, float low = -1.0f, float high = 1.0f) {
  std::vector<float> out(static_cast<std::size_t>(count));
  std::uint32_t state = seed * 2654435761u + 1;
  for (float& v : out) {
    state = state * 1664525u + 1013904223u;
    v = low + (high - low) * static_cast<float>(state >> 8) * 0x1p-24f;
  }
  return out;
}

// The worst |got - want| over `samples` indices below `count`, relative to the largest |want| among them. The last
// index is always among them, since tails are where tiles go wrong.
template <class Got, class Want>
double worst_error(long count, int samples, const Got& got, const Want& want) {
  std::mt19937_64 engine(1);
  double worst = 0, largest = 0;
  for (int s = 0; s < samples; ++s) {
    const long i = s == 0 ? count - 1 : static_cast<long>(engine() % static_cast<std::uint64_t>(count));
    const double w = want(i);
    const double error = std::abs(static_cast<double>(got(i)) - w);
    if (!std::isfinite(error)) return error;
    worst = std::max(worst, error);
    largest = std::max(largest, std::abs(w));
  }
  return largest > 0 ? worst / largest : INFINITY;
}

}  // namespace vsplat::bench
