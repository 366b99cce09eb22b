// Sparse points as cameras see them.
#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/io/views/colmap_points.h"

namespace vsplat {

// Position (u, v) of a point in the undistorted picture, in pixels, and its depth; nothing if the point is behind the
// camera or outside the picture.
std::optional<Eigen::Vector3d> seen_at(const Camera& camera, const Eigen::Vector3d& point);

// Whether so many of the points may stand for all: a tenth of them, and 30.
bool is_enough(std::size_t kept, std::size_t points);

// Keeps the points for which `keep` is true, unless too few would be left.
void keep_unless_few(std::vector<ColoredPoint>& points, const std::function<bool(const ColoredPoint&)>& keep);

// At least three pictures see it, with an error of at most two pixels.
bool is_reliable(const ColoredPoint& point);

// Keeps the reliable points, unless few would be left.
void keep_reliable(std::vector<ColoredPoint>& points);

}  // namespace vsplat
