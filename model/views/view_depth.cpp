#include "model/views/view_depth.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "model/base/lens.h"
#include "model/base/resample.h"
#include "model/io/picture/depth_file.h"
#include "model/io/views/colmap_points.h"
#include "model/views/seen_points.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr double kUnitOfWholeNumbers = 1e-3;  // nerfstudio's: a file without a unit counts millimetres

std::size_t pixels_of(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

// The value of the depth picture nearest to each pixel's centre: means across an edge would lie in the air.
std::vector<float> seen_through(const Image& depth, const Camera& listed, const Camera& shown) {
  const bool pinhole = is_pinhole(listed.distortion);
  const double far_x = std::max(shown.cx, shown.width - shown.cx) / shown.fx,
               far_y = std::max(shown.cy, shown.height - shown.cy) / shown.fy;
  const Lens lens(listed.distortion, std::hypot(far_x, far_y));
  std::vector<float> out(pixels_of(shown), 0.0f);
  for (int row = 0; row < shown.height; ++row)
    for (int column = 0; column < shown.width; ++column) {
      double x = (column + 0.5 - shown.cx) / shown.fx, y = (row + 0.5 - shown.cy) / shown.fy;
      if (!pinhole && !lens.distort(x, y, x, y)) continue;
      const double u = std::floor((listed.fx * x + listed.cx) / listed.width * depth.width),
                   v = std::floor((listed.fy * y + listed.cy) / listed.height * depth.height);
      if (u < 0 || v < 0 || u >= depth.width || v >= depth.height) continue;
      out[static_cast<std::size_t>(row) * static_cast<std::size_t>(shown.width) + static_cast<std::size_t>(column)] =
          *depth.at(static_cast<int>(u), static_cast<int>(v));
    }
  return out;
}

}  // namespace

ViewDepths listed_depths(const ViewSet& set, bool metric) {
  const auto with =
      std::count_if(set.views.begin(), set.views.end(), [](const ListedView& v) { return !v.depth.empty(); });
  if (with == 0)
    fail(Status::input, "{}: {} asks for depth pictures, and no frame names one (depth_file_path)", set.source.string(),
         Option::fit_depth);
  if (with < static_cast<std::ptrdiff_t>(set.views.size()))
    warn("{}: {} of {} frames name a depth picture; nothing is known of the depth of the others", set.source.string(),
         with, set.views.size());
  return [&set, metric](int view, const Camera& listed, const Camera& shown) {
    const std::string path = set.views[static_cast<std::size_t>(view)].depth.string();
    if (path.empty()) return std::vector<float>(pixels_of(shown), 0.0f);
    const DepthImage depth = read_depth(path);
    if (!is_same_shape(depth.values.width, depth.values.height, listed.width, listed.height))
      fail(Status::input, "{} is {} x {} pixels, its picture {} x {}: a depth picture must have its picture's shape",
           path, depth.values.width, depth.values.height, listed.width, listed.height);
    const float largest = *std::max_element(depth.values.data.begin(), depth.values.data.end());
    const double factor = !metric       ? 1.0 / std::max(largest, 1e-30f)
                          : depth.whole ? set.depth_unit.value_or(kUnitOfWholeNumbers)
                                        : set.depth_unit.value_or(1);
    std::vector<float> out = seen_through(depth.values, listed, shown);
    for (float& v : out) v = static_cast<float>(factor * v);
    return out;
  };
}

ViewDepths point_depths(const ViewSet& set) {
  std::error_code error;
  if (!std::filesystem::is_directory(set.source, error))
    fail(Status::input,
         "{}: {} asks for the depths of points, and only a COLMAP model tells which pictures see which point",
         set.source.string(), Option::fit_depth);
  const auto all = std::make_shared<const ColmapSightings>(read_colmap_sightings(set.source));
  const auto reliable = static_cast<std::size_t>(std::count_if(all->points.begin(), all->points.end(), is_reliable));
  return [&set, all, only_reliable = is_enough(reliable, all->points.size())](int view, const Camera&,
                                                                              const Camera& shown) {
    std::vector<float> out(pixels_of(shown), 0.0f);
    const auto seen = all->seen_by.find(set.views[static_cast<std::size_t>(view)].colmap_image);
    if (seen == all->seen_by.end()) return out;
    for (const std::size_t index : seen->second) {
      const ColoredPoint& point = all->points[index];
      if (only_reliable && !is_reliable(point)) continue;
      const std::optional<Eigen::Vector3d> at = seen_at(shown, point.position);
      if (!at) continue;
      const auto x = static_cast<std::size_t>(at->x()), y = static_cast<std::size_t>(at->y());
      float& depth = out[std::min(y * static_cast<std::size_t>(shown.width) + x, out.size() - 1)];
      const auto z = static_cast<float>(at->z());
      if (depth == 0 || z < depth) depth = z;
    }
    return out;
  };
}

}  // namespace vsplat
