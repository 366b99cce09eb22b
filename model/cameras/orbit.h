// Target cameras on a circle.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

struct Gaussians;

struct OrbitOptions {
  std::optional<double> radius;         // from the middle, in the world's units
  std::optional<double> elevation_deg;  // above the middle, -90 to 90
  std::optional<Eigen::Vector3d> up;
};

// A camera at `eye` that looks at `target`, its picture's upper side towards `up` (any other where it looks along up).
Eigen::Matrix4d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up);

// The direction that is up for these cameras: across their horizontal axes, on the side of their -y axes.
Eigen::Vector3d up_axis(std::span<const Camera> cameras);

// `count` cameras of width x height pixels on a circle about `centre` with the median distance, elevation and
// (narrower) field of view of the inputs, about their up axis; the first one has the azimuth of the first input, the
// others follow counter-clockwise seen from above. Inputs: at least one, intrinsics known, in the same world.
std::vector<Camera> orbit_about(std::span<const Camera> inputs, const Eigen::Vector3d& centre, int count, int width,
                                int height, const OrbitOptions& options = {});

// For a bare scene: about the median position of the Gaussians, up = -y, level, 50 degrees, from where a sphere that
// holds the centres of 95 % of them fits into the picture with a tenth to spare.
std::vector<Camera> orbit_about_scene(const Gaussians& scene, int count, int width, int height,
                                      const OrbitOptions& options = {});

}  // namespace vsplat
