#include "model/base/scene_statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/statistics.h"

namespace vsplat {
namespace {

constexpr float kTransparent = 0.1f, kInvisible = 1 / 255.0f;
constexpr double kHuge = 0.1;    // of the diagonal
constexpr double kDistant = 10;  // times the median distance

bool all_finite(const std::vector<float>& values, std::size_t each, std::size_t k) {
  const auto first = values.begin() + static_cast<std::ptrdiff_t>(each * k);
  return std::all_of(first, first + static_cast<std::ptrdiff_t>(each), [](float v) { return std::isfinite(v); });
}

// The Gaussians whose values are all finite.
std::vector<std::size_t> finite_ones(const Gaussians& g) {
  const auto axes = static_cast<std::size_t>(scales_of(g.kind));
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < g.count; ++k)
    if (all_finite(g.means, 3, k) && all_finite(g.scales, axes, k) && all_finite(g.quats, 4, k) &&
        all_finite(g.opacities, 1, k) && all_finite(g.sh, 3 * g.sh_count(), k))
      out.push_back(k);
  return out;
}

std::uint64_t count_above(const std::vector<double>& values, double limit) {
  return static_cast<std::uint64_t>(
      std::count_if(values.begin(), values.end(), [limit](double v) { return v > limit; }));
}

std::vector<double> distances_from_middle(const Gaussians& g, const std::vector<std::size_t>& ones,
                                          const Eigen::Vector3d& middle) {
  std::vector<double> out;
  out.reserve(ones.size());
  for (const std::size_t k : ones)
    out.push_back((Eigen::Vector3d(g.means[3 * k], g.means[3 * k + 1], g.means[3 * k + 2]) - middle).norm());
  return out;
}

std::vector<double> sizes_of(const Gaussians& g, const std::vector<std::size_t>& ones) {
  const auto axes = static_cast<std::size_t>(scales_of(g.kind));
  std::vector<double> out;
  out.reserve(ones.size());
  for (const std::size_t k : ones) {
    const float* const s = &g.scales[axes * k];
    out.push_back(static_cast<double>(*std::max_element(s, s + axes)));
  }
  return out;
}

}  // namespace

SceneStatistics statistics_of(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  SceneStatistics out;
  const std::vector<std::size_t> ones = finite_ones(g);
  out.not_finite = g.count - ones.size();
  if (ones.empty()) return out;
  std::vector<double> values(ones.size());
  Eigen::Vector3d middle;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::transform(ones.begin(), ones.end(), values.begin(),
                   [&](std::size_t k) { return static_cast<double>(g.means[3 * k + static_cast<std::size_t>(axis)]); });
    std::sort(values.begin(), values.end());
    out.low[axis] = scene.offset[axis] + values.front();
    out.high[axis] = scene.offset[axis] + values.back();
    out.low_1[axis] = scene.offset[axis] + quantile(values, 0.01);
    out.high_99[axis] = scene.offset[axis] + quantile(values, 0.99);
    middle[axis] = median(values);
  }
  for (const std::size_t k : ones) {
    out.transparent += g.opacities[k] < kTransparent;
    out.invisible += g.opacities[k] < kInvisible;
  }
  std::transform(ones.begin(), ones.end(), values.begin(),
                 [&](std::size_t k) { return static_cast<double>(g.opacities[k]); });
  out.median_opacity = median(values);
  const std::vector<double> sizes = sizes_of(g, ones), distances = distances_from_middle(g, ones, middle);
  out.median_size = median(sizes);
  out.largest_size = *std::max_element(sizes.begin(), sizes.end());
  out.huge = count_above(sizes, kHuge * (out.high_99 - out.low_1).norm());
  out.distant = count_above(distances, kDistant * median(distances));
  return out;
}

}  // namespace vsplat
