// Scenes to start a fit from when no network has made one.
#pragma once
#include <cstdint>
#include <span>

#include "model/base/scene.h"
#include "model/io/views/colmap_points.h"
#include "model/views/placement.h"

namespace vsplat {

// Default number of Gaussians of a random start.
inline constexpr long kRandomStart = 5000;

// Both functions return isotropic Gaussians in the world, with opacity 0.1 and without view-dependent colour. The
// standard deviation of each is the mean distance to its three nearest neighbours, clamped to 1e-4 to 0.1 of the cube's
// edge.

// Uses the points inside the cube, with their colours. `most` above 0 limits their number, spread evenly over the list.
// Logs how many points lie in the cube. Error(input) if none does.
Scene scene_from_points(std::span<const ColoredPoint> points, const Placement& placement, long most = 0);

// Grey Gaussians, uniformly distributed in the cube; equal seeds give equal scenes.
Scene random_scene(const Placement& placement, long count, std::uint64_t seed);

}  // namespace vsplat
