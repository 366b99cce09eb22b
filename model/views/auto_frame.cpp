#include "model/views/auto_frame.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "model/base/statistics.h"
#include "model/views/point_cube.h"
#include "runtime/fail.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

struct Ray {
  Eigen::Vector3d origin, direction;  // `direction` has unit length
};

// The point with the smallest sum of distances to the lines, by reweighted least squares.
Eigen::Vector3d nearest_point(std::vector<Ray> rays) {
  // Work relative to the first origin if it is far away, because the solver may lose four digits.
  double spread = 0;
  for (const Ray& ray : rays) spread = std::max(spread, (ray.origin - rays[0].origin).norm());
  const Eigen::Vector3d offset = offset_for(rays[0].origin, spread);
  for (Ray& ray : rays) ray.origin -= offset;
  std::vector<double> weights(rays.size(), 1.0);
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int step = 0; step < 60; ++step) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double total = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Eigen::Vector3d& d = rays[i].direction;
      const Eigen::Matrix3d off = weights[i] * (Eigen::Matrix3d::Identity() - d * d.transpose());
      A += off;
      b += off * rays[i].origin;
      total += weights[i];
    }
    A /= total, b /= total;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
    if (eigen.eigenvalues()[0] < 1e-4)  // directions within about half a degree of each other
      fail(Status::input,
           "the object cannot be found from {}: the viewing directions are parallel; say where it is with "
           "{} and {}",
           rays.size() == 1 ? "one view" : "these views", Option::center, Option::scale);
    const Eigen::Vector3d next = A.ldlt().solve(b);
    std::vector<double> reach(rays.size()), distance(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Eigen::Vector3d v = next - rays[i].origin;
      reach[i] = v.norm();
      distance[i] = (v - v.dot(rays[i].direction) * rays[i].direction).norm();
    }
    const double floor = 1e-3 * std::max(median(reach), 1e-12);
    for (std::size_t i = 0; i < rays.size(); ++i) weights[i] = floor / std::max(distance[i], floor);
    const double moved = (next - p).norm();
    p = next;
    if (step > 0 && moved < 1e-3 * floor) break;
  }
  return p + offset;
}

Ray ray_through(const Camera& camera, double u, double v) {
  const Eigen::Vector3d d((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
  return {camera.centre(), (camera.w2c.topLeftCorner<3, 3>().transpose() * d).normalized()};
}

// The largest cube in the network's orientation (the first view's axes) that stays in front of all cameras.
double largest_edge(std::span<const Camera> cameras, const Eigen::Vector3d& centre) {
  double out = std::numeric_limits<double>::infinity();
  const Eigen::Matrix3d first = cameras[0].w2c.topLeftCorner<3, 3>().transpose();
  for (const Camera& c : cameras) {
    const Eigen::RowVector3d forward = c.w2c.row(2).head<3>();
    const double z = forward.dot(centre - c.centre());
    if (z > 0) out = std::min(out, 2 * z / (forward * first).cwiseAbs().sum());
  }
  return out;
}

// From the centres of the masks if at least two views have one, else from the optical axes.
EstimatedPlacement find_centre(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents) {
  std::vector<Ray> axes, middles;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    axes.push_back(ray_through(c, c.cx, c.cy));
    if (extents.empty() || !extents[i]) continue;
    const MaskExtent& m = *extents[i];
    middles.push_back(ray_through(c, 0.5 * (m.x0 + m.x1), 0.5 * (m.y0 + m.y1)));
  }
  if (middles.size() >= 2)
    return {{nearest_point(middles)}, fmt::format("centre from the middles of {} masks", middles.size())};
  return {{nearest_point(axes)}, fmt::format("centre from the optical axes of {} views", axes.size())};
}

struct EstimatedEdge {
  double edge;
  std::string from;
};

// From the extents of the masks if there are any, else from the cameras' distances and fields of view.
EstimatedEdge find_edge(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents,
                        const Eigen::Vector3d& centre) {
  std::vector<double> sizes, distances, spans;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    const double z = std::abs(c.w2c.row(2).head<3>().dot(centre - c.centre()));
    distances.push_back((centre - c.centre()).norm());
    spans.push_back(std::sqrt(c.width / c.fx * (c.height / c.fy)));
    if (extents.empty() || !extents[i]) continue;
    const MaskExtent& m = *extents[i];
    sizes.push_back(z * std::max((m.x1 - m.x0) / c.fx, (m.y1 - m.y0) / c.fy));
  }
  if (!sizes.empty())
    return {1.2 * quantile(sizes, 0.9), fmt::format("edge from the extent of {} masks", sizes.size())};
  return {median(distances) * median(spans) / 1.5,
          fmt::format("edge from the median distance {:.4g} and field of view {:.3g} degrees", median(distances),
                      2 * std::atan(0.5 * median(spans)) * 180 / M_PI)};
}

// From masks if there are any, else from the optical axes.
EstimatedPlacement frame_without_points(std::span<const Camera> cameras,
                                        std::span<const std::optional<MaskExtent>> extents,
                                        const std::optional<Eigen::Vector3d>& centre) {
  EstimatedPlacement out;
  if (centre) {
    out.placement.centre = *centre;
  } else {
    out = find_centre(cameras, extents);
    out.from += ", ";
  }
  const EstimatedEdge edge = find_edge(cameras, extents, out.placement.centre);
  out.placement.edge = edge.edge;
  out.from += edge.from;
  return out;
}

// Whether at least nine in ten masks contain the point. A mask's extent is a box; it is widened a little, in case it
// was cut too tightly.
bool is_masked_in(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents,
                  const Eigen::Vector3d& point) {
  constexpr double widened = 0.02;
  int masks = 0, held = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!extents[i]) continue;
    ++masks;
    const Camera& c = cameras[i];
    const MaskExtent& m = *extents[i];
    const Eigen::Vector3d p = c.w2c.topLeftCorner<3, 3>() * (point - c.centre());
    if (!(p.z() > 0)) continue;
    const double u = c.fx * p.x() / p.z() + c.cx, v = c.fy * p.y() / p.z() + c.cy;
    const double x = widened * (m.x1 - m.x0), y = widened * (m.y1 - m.y0);
    held += u >= m.x0 - x && u <= m.x1 + x && v >= m.y0 - y && v <= m.y1 + y;
  }
  return 10 * held >= 9 * masks;
}

std::optional<EstimatedPlacement> frame_by_points(std::span<const Camera> cameras,
                                                  std::span<const std::optional<MaskExtent>> extents,
                                                  const std::optional<Eigen::Vector3d>& centre,
                                                  std::span<const ColoredPoint> points) {
  constexpr double much_larger = 1.5;
  std::optional<PointCube> cube = cube_of_points(cameras, points, centre);
  if (!cube) return std::nullopt;
  const auto masks =
      std::count_if(extents.begin(), extents.end(), [](const auto& extent) { return extent.has_value(); });
  std::string which =
      fmt::format("{} of the {} points, the dense ones that most views show", cube->points, points.size());
  if (masks >= 2 &&
      cube->placement.edge >
          much_larger * find_edge(cameras, extents, find_centre(cameras, extents).placement.centre).edge) {
    std::vector<ColoredPoint> masked;
    for (const ColoredPoint& point : points)
      if (is_masked_in(cameras, extents, point.position)) masked.push_back(point);
    cube = cube_of_points(cameras, masked, centre);
    if (!cube) return std::nullopt;
    which = fmt::format("{} of the {} points, the dense ones that the masks hold", cube->points, points.size());
  }
  return EstimatedPlacement{cube->placement, "from " + which, false};
}

}  // namespace

std::optional<MaskExtent> mask_extent(const Image& mask) {
  ImageRows rows(mask);
  return mask_extent(rows);
}

std::optional<MaskExtent> mask_extent(PixelRows& mask) {
  std::vector<float> row(mask.row_size());
  std::vector<double> columns(mask.width, 0.0), rows(mask.height, 0.0);
  double total = 0;
  for (int y = 0; y < mask.height; ++y) {
    mask.next(row.data());
    for (int x = 0; x < mask.width; ++x)
      if (row[static_cast<std::size_t>(x + 1) * mask.channels - 1] > 0.5f) columns[x] += 1, rows[y] += 1, total += 1;
  }
  if (total == 0) return std::nullopt;
  const double stray = 0.002 * total;
  const auto first = [&](const std::vector<double>& counts, bool from_end) {
    double seen = 0;
    const int n = static_cast<int>(counts.size());
    for (int i = 0; i < n; ++i) {
      seen += counts[from_end ? n - 1 - i : i];
      if (seen > stray) return i;
    }
    return n - 1;
  };
  return MaskExtent{static_cast<double>(first(columns, false)), static_cast<double>(first(rows, false)),
                    static_cast<double>(mask.width - first(columns, true)),
                    static_cast<double>(mask.height - first(rows, true))};
}

std::optional<Eigen::Vector3d> where_axes_meet(std::span<const Camera> cameras) {
  try {
    return find_centre(cameras, {}).placement.centre;
  } catch (const Error& e) {
    if (e.status() != Status::input) throw;
    return std::nullopt;
  }
}

EstimatedPlacement auto_frame(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents,
                              const std::optional<Eigen::Vector3d>& centre, std::span<const ColoredPoint> points) {
  if (cameras.empty()) fail(Status::usage, "no camera to find the object from");
  if (!extents.empty() && extents.size() != cameras.size())
    fail(Status::internal, "{} mask extents for {} cameras", extents.size(), cameras.size());
  const std::optional<EstimatedPlacement> by_points = frame_by_points(cameras, extents, centre, points);
  EstimatedPlacement out = by_points ? *by_points : frame_without_points(cameras, extents, centre);
  double& edge = out.placement.edge;
  if (const double most = 0.9 * largest_edge(cameras, out.placement.centre); edge > most) {
    edge = most;
    out.from += ", made smaller to stay in front of every camera";
  }
  if (!(edge > 0) || !std::isfinite(edge))
    fail(Status::input, "the object's size cannot be found from these views: the cameras are at its centre {}; give {}",
         to_text(out.placement.centre), Option::scale);
  return out;
}

}  // namespace vsplat
