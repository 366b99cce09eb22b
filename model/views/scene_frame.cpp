#include "model/views/scene_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/statistics.h"
#include "runtime/fail.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr double kBeyond = 1.1, kStray = 3;       // of the largest and of the median distance
constexpr double kNear = 0.01, kNearest = 0.001;  // this share of points may be nearer than the nearest
constexpr double kOnePlace = 1e-9;                // relative to the distance from the origin

// Depths of all points in all pictures.
std::vector<double> depths_of(std::span<const Camera> cameras, std::span<const ColoredPoint> points) {
  std::vector<double> out;
  for (const Camera& camera : cameras)
    for (const ColoredPoint& point : points)
      if (const auto at = seen_at(camera, point.position)) out.push_back(at->z());
  return out;
}

}  // namespace

SceneFrame scene_frame(std::span<const Camera> cameras, std::span<const ColoredPoint> points) {
  if (cameras.empty()) fail(Status::usage, "no camera to fit a scene to");
  std::vector<Vector3d> places;
  Vector3d mean = Vector3d::Zero();
  for (const Camera& camera : cameras) {
    places.push_back(camera.centre());
    mean += (places.back() - places.front()) / static_cast<double>(cameras.size());
  }
  mean += places.front();
  const Vector3d middle = median(places);
  std::vector<double> distances;
  distances.reserve(places.size());
  for (const Vector3d& place : places) distances.push_back((place - middle).norm());
  const double farthest = *std::max_element(distances.begin(), distances.end());
  const double usual = median(distances);
  SceneFrame out;
  out.placement.centre = mean;
  std::string from;
  if (farthest > kOnePlace * mean.norm()) {
    out.placement.edge = kBeyond * (usual > 0 ? std::min(farthest, kStray * usual) : farthest);
    from = fmt::format("from {} cameras", cameras.size());
  }
  const std::vector<double> depths = depths_of(cameras, points);
  if (from.empty()) {
    if (depths.empty())
      fail(Status::input,
           "all {} cameras are at one place, {}, and no point of the scene is in their pictures: the scene's size is "
           "unknown. Photographs from several places, or a model with points, tell it",
           cameras.size(), to_text(mean));
    out.placement.edge = median(depths);
    from = "from the points, since all cameras are at one place";
  }
  out.near = kNear * (depths.empty() ? out.placement.edge : quantile(depths, kNearest));
  out.found = fmt::format("the whole scene: centre {}, unit of length {:.6g} ({}), near plane {:.6g}",
                          to_text(out.placement.centre), out.placement.edge, from, out.near);
  return out;
}

std::string cut_by_near(std::span<const Camera> cameras, std::span<const ColoredPoint> points, double near) {
  std::vector<bool> seen(points.size(), false), cut(points.size(), false);
  for (const Camera& camera : cameras)
    for (std::size_t i = 0; i < points.size(); ++i)
      if (const auto at = seen_at(camera, points[i].position)) {
        seen[i] = true;
        if (at->z() < near) cut[i] = true;
      }
  const auto cuts = std::count(cut.begin(), cut.end(), true), all = std::count(seen.begin(), seen.end(), true);
  if (cuts * 100 <= all) return "";
  return fmt::format(
      "the near plane at {:.6g} cuts away {} of the {} points that the pictures see: a smaller {} shows "
      "them",
      near, cuts, all, Option::near_plane);
}

}  // namespace vsplat
