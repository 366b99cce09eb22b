#include "model/views/point_cube.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "model/base/point_tree.h"
#include "model/base/statistics.h"
#include "model/views/seen_points.h"

namespace vsplat {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;

constexpr std::size_t kLeastPoints = 30, kMostPoints = 50000;  // of more, an even sample is used
constexpr std::size_t kNeighbours = 8;
constexpr double kThinner = 3;  // times the median distance to the last neighbour
constexpr double kTrimmed = 0.002, kMargin = 1.05;

std::vector<ColoredPoint> even_sample(std::span<const ColoredPoint> points) {
  const std::size_t n = std::min(points.size(), kMostPoints);
  std::vector<ColoredPoint> out;
  out.reserve(n);
  for (std::size_t i = 0; i < n; ++i) out.push_back(points[i * points.size() / n]);
  return out;
}

// Removes points whose neighbours are much farther away than usual. Works relative to `offset` to keep the tree's
// numbers small.
Positions dense_ones(const std::vector<ColoredPoint>& points, const Vector3d& offset) {
  PointRows rows(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i].position - offset;
  const PointsForTree for_tree{rows};
  const PointTree tree(3, for_tree);
  std::vector<double> distances;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    std::array<Eigen::Index, kNeighbours + 1> found{};  // including the point itself
    std::array<double, kNeighbours + 1> squared{};
    const std::size_t n = tree.knnSearch(rows.row(i).data(), found.size(), found.data(), squared.data());
    distances.push_back(std::sqrt(squared[n - 1]));
  }
  const double most = kThinner * median(distances);
  Positions out;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (distances[i] <= most) out.push_back(points[i].position);
  return out;
}

// The middle between the quantiles `low` and 1 - `low` along each world axis.
Vector3d middle(const Positions& points, double low) {
  Vector3d out;
  std::vector<double> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = points[i][axis];
    out[axis] = 0.5 * (quantile(values, low) + quantile(values, 1 - low));
  }
  return out;
}

// Median over the cameras of the half-width of the picture at the point's distance, by the longer side.
double reach(std::span<const Camera> cameras, const Vector3d& point) {
  std::vector<double> out;
  for (const Camera& c : cameras)
    out.push_back(0.5 * (point - c.centre()).norm() * std::max(c.width / c.fx, c.height / c.fy));
  return median(out);
}

Positions near_to(const Positions& points, const Vector3d& centre, double radius) {
  Positions out;
  for (const Vector3d& p : points)
    if ((p - centre).norm() <= radius) out.push_back(p);
  return out;
}

// Edge of a cube about `centre` that contains the points in the orientation of the world and of every camera.
double edge_about(const Positions& points, const Vector3d& centre, std::span<const Camera> cameras) {
  std::vector<Matrix3d> axes{Matrix3d::Identity()};
  for (const Camera& c : cameras) axes.emplace_back(c.w2c.topLeftCorner<3, 3>());
  double out = 0;
  std::vector<double> far(points.size());
  for (const Matrix3d& to_axes : axes) {
    for (std::size_t i = 0; i < points.size(); ++i) far[i] = (to_axes * (points[i] - centre)).cwiseAbs().maxCoeff();
    out = std::max(out, 2 * quantile(far, 1 - kTrimmed));
  }
  return kMargin * out;
}

}  // namespace

std::optional<PointCube> cube_of_points(std::span<const Camera> cameras, std::span<const ColoredPoint> all,
                                        const std::optional<Vector3d>& centre) {
  std::vector<ColoredPoint> points = even_sample(all);
  if (points.size() < kLeastPoints || cameras.empty()) return std::nullopt;
  keep_reliable(points);
  keep_unless_few(points, [&](const ColoredPoint& p) {
    const auto seen = std::count_if(cameras.begin(), cameras.end(),
                                    [&](const Camera& c) { return seen_at(c, p.position).has_value(); });
    return 2 * static_cast<std::size_t>(seen) >= cameras.size();
  });
  const Positions dense = dense_ones(points, points.front().position);
  if (dense.size() < kLeastPoints) return std::nullopt;
  Vector3d at = centre.value_or(middle(dense, 0.5));
  Positions near = near_to(dense, at, reach(cameras, at));
  for (int step = 0; step < 20 && !centre && near.size() >= kLeastPoints; ++step) {
    const Vector3d next = middle(near, 0.01);
    const bool settled = next == at;
    at = next;
    near = near_to(dense, at, reach(cameras, at));
    if (settled) break;
  }
  if (near.size() < kLeastPoints) return std::nullopt;
  if (!centre) at = middle(near, 0.5 * kTrimmed);
  const double edge = edge_about(near, at, cameras);
  if (!(edge > 0)) return std::nullopt;
  return PointCube{{at, edge}, near.size()};
}

}  // namespace vsplat
