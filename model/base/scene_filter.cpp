#include "model/base/scene_filter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "model/base/point_tree.h"
#include "model/base/scene_edit.h"
#include "model/base/statistics.h"

namespace vsplat {
namespace {

Eigen::Vector3d mean_of(const Gaussians& g, std::size_t k) {
  return {g.means[3 * k], g.means[3 * k + 1], g.means[3 * k + 2]};
}

double size_of(const Gaussians& g, std::size_t k) {
  const auto axes = static_cast<std::size_t>(scales_of(g.kind));
  const auto first = g.scales.begin() + static_cast<std::ptrdiff_t>(axes * k);
  return *std::max_element(first, first + static_cast<std::ptrdiff_t>(axes));
}

bool contains(const Box& box, const Eigen::Vector3d& x) {
  return (x.array() >= box.low.array()).all() && (x.array() <= box.high.array()).all();
}

// The counter of the first rule that removes the Gaussian; null if it stays.
std::uint64_t* removed_by(const Scene& scene, const SceneFilter& what, std::size_t k, FilteredGaussians& counts) {
  const Gaussians& g = scene.gaussians;
  const Eigen::Vector3d at = scene.offset + mean_of(g, k);
  if (what.box && !contains(*what.box, at)) return &counts.box;
  if (what.sphere && !((at - what.sphere->centre).norm() <= what.sphere->radius)) return &counts.sphere;
  if (static_cast<double>(g.opacities[k]) < what.min_opacity) return &counts.opacity;
  if (what.max_size > 0 && size_of(g, k) > what.max_size) return &counts.size;
  return nullptr;
}

}  // namespace

FilteredGaussians filter(Scene& scene, const SceneFilter& what) {
  FilteredGaussians out;
  keep(scene.gaussians, [&](std::size_t k) {
    std::uint64_t* const counter = removed_by(scene, what, k, out);
    if (counter) ++*counter;
    return !counter;
  });
  if (!what.without_floaters) return out;
  const std::vector<bool> removed = floaters(scene.gaussians);
  out.floaters = static_cast<std::uint64_t>(std::count(removed.begin(), removed.end(), true));
  keep(scene.gaussians, [&](std::size_t k) { return !removed[k]; });
  return out;
}

std::vector<bool> floaters(const Gaussians& g) {
  std::vector<bool> out(g.count, false);
  if (g.count <= static_cast<std::size_t>(kFloaterNeighbours)) return out;
  PointRows rows(static_cast<Eigen::Index>(g.count), 3);
  for (std::size_t k = 0; k < g.count; ++k) rows.row(static_cast<Eigen::Index>(k)) = mean_of(g, k);
  const PointsForTree points{rows};
  const PointTree tree(3, points);
  constexpr std::size_t found = kFloaterNeighbours + 1;  // with the Gaussian itself
  std::vector<double> distances(g.count);
  for (std::size_t k = 0; k < g.count; ++k) {
    std::array<Eigen::Index, found> nearest{};
    std::array<double, found> squares{};
    const std::size_t n =
        tree.knnSearch(rows.row(static_cast<Eigen::Index>(k)).data(), found, nearest.data(), squares.data());
    for (std::size_t i = 0; i < n; ++i) distances[k] += std::sqrt(squares[i]) / kFloaterNeighbours;
  }
  const double usual = median(distances);
  // More than half lie on others: they give no distance to compare with.
  if (!(usual > 0)) return out;
  for (std::size_t k = 0; k < g.count; ++k)
    out[k] = distances[k] > std::max(kFloaterDistance * usual, kFloaterReach * size_of(g, k));
  return out;
}

}  // namespace vsplat
