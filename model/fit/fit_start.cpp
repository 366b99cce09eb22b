#include "model/fit/fit_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "model/base/point_tree.h"
#include "model/base/rng.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr std::size_t kNeighbours = 3;
constexpr double kLowScale = 1e-4, kHighScale = 0.1;  // of the cube's edge
constexpr float kOpacity = 0.1f;

using Positions = PointRows;

// Mean distance of each position to its nearest neighbours, in the unit of `positions`.
std::vector<double> neighbour_distances(const Positions& positions) {
  const PointsForTree points{positions};
  const PointTree tree(3, points);
  std::vector<double> out;
  out.reserve(static_cast<std::size_t>(positions.rows()));
  for (Eigen::Index i = 0; i < positions.rows(); ++i) {
    std::array<Eigen::Index, kNeighbours + 1> found{};  // includes the point itself, or a duplicate of it
    std::array<double, kNeighbours + 1> squared{};
    const std::size_t n = tree.knnSearch(positions.row(i).data(), found.size(), found.data(), squared.data());
    double sum = 0;
    for (std::size_t k = 1; k < n; ++k) sum += std::sqrt(squared[k]);
    out.push_back(n > 1 ? sum / static_cast<double>(n - 1) : kHighScale);
  }
  return out;
}

// `positions`: relative to the cube's centre, in units of its edge.
Scene round_ones(const Positions& positions, const std::vector<std::array<float, 3>>& colours,
                 const Placement& placement) {
  const auto n = static_cast<std::size_t>(positions.rows());
  Scene out;
  out.near = static_cast<float>(kNearInObject * placement.edge);
  out.offset = offset_for(placement.centre, placement.edge);
  const Eigen::Vector3d centre = placement.centre - out.offset;
  Gaussians& g = out.gaussians;
  g.count = n;
  g.quats.assign(4 * n, 0.0f);
  g.opacities.assign(n, kOpacity);
  const std::vector<double> distances = neighbour_distances(positions);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d at = centre + placement.edge * positions.row(static_cast<Eigen::Index>(i)).transpose();
    const double size = placement.edge * std::clamp(distances[i], kLowScale, kHighScale);
    g.quats[4 * i] = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      g.means.push_back(static_cast<float>(at[static_cast<Eigen::Index>(c)]));
      g.scales.push_back(static_cast<float>(size));
      g.sh.push_back(static_cast<float>((colours[i][c] - 0.5) / kShC0));
    }
  }
  return out;
}

}  // namespace

Scene scene_from_points(std::span<const ColoredPoint> points, const Placement& placement, long most) {
  std::vector<const ColoredPoint*> inside;
  for (const ColoredPoint& point : points)
    if (((point.position - placement.centre) / placement.edge).cwiseAbs().maxCoeff() <= 0.5) inside.push_back(&point);
  if (inside.empty())
    fail(Status::input,
         "none of the {} points lies in the object's cube, centre {}, edge {:.6g}: set it with {} and {}",
         points.size(), to_text(placement.centre), placement.edge, Option::center, Option::scale);
  const std::size_t n = most > 0 ? std::min(inside.size(), static_cast<std::size_t>(most)) : inside.size();
  info("{} of the {} points lie in the object's cube{}", inside.size(), points.size(),
       n < inside.size() ? fmt::format(", {} of them are used", n) : "");
  Positions positions(static_cast<Eigen::Index>(n), 3);
  std::vector<std::array<float, 3>> colours;
  for (std::size_t i = 0; i < n; ++i) {
    const ColoredPoint& point = *inside[i * inside.size() / n];
    positions.row(static_cast<Eigen::Index>(i)) = (point.position - placement.centre).transpose() / placement.edge;
    colours.push_back({point.rgb[0] / 255.0f, point.rgb[1] / 255.0f, point.rgb[2] / 255.0f});
  }
  return round_ones(positions, colours, placement);
}

Scene random_scene(const Placement& placement, long count, std::uint64_t seed) {
  Positions positions(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto random = philox4x32_10({static_cast<std::uint32_t>(i), 0, stream_of("fit.start"), 0}, rng_key(seed));
    for (std::size_t c = 0; c < 3; ++c)
      positions(i, static_cast<Eigen::Index>(c)) = static_cast<double>(uniform01(random[c])) - 0.5;
  }
  return round_ones(positions, std::vector<std::array<float, 3>>(static_cast<std::size_t>(count), {0.5f, 0.5f, 0.5f}),
                    placement);
}

}  // namespace vsplat
