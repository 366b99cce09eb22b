#include "model/views/seen_points.h"

#include <algorithm>

namespace vsplat {
namespace {

constexpr std::uint64_t kLeastTrack = 3;
constexpr double kMostError = 2;  // pixels
constexpr std::size_t kLeastPoints = 30;

}  // namespace

std::optional<Eigen::Vector3d> seen_at(const Camera& c, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = c.w2c.topLeftCorner<3, 3>() * (point - c.centre());
  if (!(p.z() > 0)) return std::nullopt;
  const double u = c.fx * p.x() / p.z() + c.cx, v = c.fy * p.y() / p.z() + c.cy;
  if (!(u >= 0 && u <= c.width && v >= 0 && v <= c.height)) return std::nullopt;
  return Eigen::Vector3d(u, v, p.z());
}

bool is_enough(std::size_t kept, std::size_t points) { return kept >= std::max(kLeastPoints, points / 10); }

void keep_unless_few(std::vector<ColoredPoint>& points, const std::function<bool(const ColoredPoint&)>& keep) {
  std::vector<ColoredPoint> kept;
  std::copy_if(points.begin(), points.end(), std::back_inserter(kept), keep);
  if (is_enough(kept.size(), points.size())) points = std::move(kept);
}

bool is_reliable(const ColoredPoint& point) { return point.track >= kLeastTrack && point.error <= kMostError; }

void keep_reliable(std::vector<ColoredPoint>& points) { keep_unless_few(points, is_reliable); }

}  // namespace vsplat
