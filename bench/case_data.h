// Random data for the cases, and sampled checks.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
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

// The voxels of a grid of r^3 that lie nearest a sphere of radius 0.3, so many of them, ascending: a surface, as a
// trained model selects.
inline std::vector<int> shell(int r, std::size_t count) {
  std::vector<std::pair<double, int>> by_distance;
  for (int i = 0; i < r * r * r; ++i) {
    const auto centre = [&](int at) { return (at + 0.5) / r - 0.5; };
    by_distance.emplace_back(std::abs(std::hypot(centre(i / (r * r)), centre(i / r % r), centre(i % r)) - 0.3), i);
  }
  std::sort(by_distance.begin(), by_distance.end());
  std::vector<int> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(by_distance.at(i).second);
  std::sort(out.begin(), out.end());
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
