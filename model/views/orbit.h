// Target cameras on a circle.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

struct Scene;

struct OrbitOptions {
  std::optional<double> radius;         // from the middle, in world units
  std::optional<double> elevation_deg;  // above the middle, -90 to 90
  std::optional<Eigen::Vector3d> up;
  double edge = 0;  // of the object's cube: orbit_about() widens the field of view to contain it; 0: unknown
};

// A camera at `eye` that looks at `target`, with its picture's upper side towards `up` (arbitrary if it looks along
// up).
Eigen::Matrix4d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up);

// The up direction of these cameras: perpendicular to their horizontal axes, on the side of their -y axes.
Eigen::Vector3d up_axis(std::span<const Camera> cameras);

// The world's up direction from all available cameras: up_axis(), or the nearest world axis (+-x, +-y, +-z) if it is
// within the cameras' roll about up_axis() (root mean square, limited to 3 to 30 degrees). Length 1. At least one
// camera.
Eigen::Vector3d world_up(std::span<const Camera> cameras);

// `count` cameras of width x height pixels on a circle about `centre` with the median distance, elevation and
// (narrower) field of view of the inputs, about their up axis. The first camera has the azimuth of the first input; the
// others follow counter-clockwise seen from above. With options.edge, the field of view is widened until the cylinder
// inscribed in the cube keeps a margin of a twentieth of the picture. Inputs: at least one, with known intrinsics, in
// the same world.
std::vector<Camera> orbit_about(std::span<const Camera> inputs, const Eigen::Vector3d& centre, int count, int width,
                                int height, const OrbitOptions& options = {});

// An orbit for a scene without cameras, about the middle of its visible part (Gaussians of opacity 0.1 or more, or all
// if there are none; the middle of their 2nd to 98th percentiles along up and across). It is level, with a field of
// view of 50 degrees, at the distance that keeps a margin of a twentieth of the picture on every side all the way
// round. Gaussians farther away than 1.3 times the 95th percentile are ignored, and so is a sky far around the others.
// Up is taken from the options, else from the scene, else -y. The first camera is at the front: -y in z-up worlds, +z
// in y-up worlds, -z in worlds with -y up.
std::vector<Camera> orbit_about_scene(const Scene& scene, int count, int width, int height,
                                      const OrbitOptions& options = {});

// Such orbits at several elevations, one after the other.
struct Ring {
  double elevation_deg = 0;  // -90 to 90
  int count = 1;             // cameras
};
std::vector<Camera> rings_about_scene(const Scene& scene, std::span<const Ring> rings, int width, int height);

}  // namespace vsplat
