// Target cameras on a circle.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

struct Scene;

struct OrbitOptions {
  std::optional<double> radius;         // from the middle, in the world's units
  std::optional<double> elevation_deg;  // above the middle, -90 to 90
  std::optional<Eigen::Vector3d> up;
  double edge = 0;  // of the object's cube: orbit_about() widens the field of view so that it fits; 0: not known
};

// A camera at `eye` that looks at `target`, its picture's upper side towards `up` (any other where it looks along up).
Eigen::Matrix4d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up);

// The direction that is up for these cameras: across their horizontal axes, on the side of their -y axes.
Eigen::Vector3d up_axis(std::span<const Camera> cameras);

// The world's up, from all cameras that there are: up_axis(), or the axis of the world next to it (+-x, +-y, +-z) where
// that is as likely: as near to it as the cameras are rolled about it (root mean square), at least 3 and at most 30
// degrees. Of length 1. At least one camera.
Eigen::Vector3d world_up(std::span<const Camera> cameras);

// `count` cameras of width x height pixels on a circle about `centre` with the median distance, elevation and
// (narrower) field of view of the inputs, about their up axis; the first one has the azimuth of the first input, the
// others follow counter-clockwise seen from above. With options.edge the field of view is so wide that the cylinder
// inscribed in the cube keeps a margin of a twentieth of the picture. Inputs: at least one, intrinsics known, in the
// same world.
std::vector<Camera> orbit_about(std::span<const Camera> inputs, const Eigen::Vector3d& centre, int count, int width,
                                int height, const OrbitOptions& options = {});

// For a bare scene: about the middle of what can be seen of it (Gaussians of opacity 0.1 and more, all where there are
// none; the middle of their 2nd to 98th percentile along up and across), level, with 50 degrees of view, from where it
// keeps a margin of a twentieth of the picture on every side all the way round. What is farther off than 1.3 times the
// 95th percentile does not count. Up is what the options say, else the scene, else -y; the first camera stands where
// z-up worlds have their front, at -y, y-up worlds at +z, -y-up ones at -z.
std::vector<Camera> orbit_about_scene(const Scene& scene, int count, int width, int height,
                                      const OrbitOptions& options = {});

}  // namespace vsplat
