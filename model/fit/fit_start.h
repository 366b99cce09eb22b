// Scenes to begin a fit with where nobody has made one yet.
#pragma once
#include <cstdint>
#include <span>

#include "model/base/scene.h"
#include "model/io/views/colmap_points.h"
#include "model/views/placement.h"

namespace vsplat {

// How many Gaussians a random start has where nothing is asked for.
inline constexpr long kRandomStart = 5000;

// Both: round Gaussians of opacity 0.1 without view-dependent colour, in the world; the standard deviation of each is
// the mean distance to its three nearest neighbours, within 1e-4 and 0.1 of the cube's edge.

// Of the points that lie in the cube, in their colours; `most` above 0 limits their number, evenly over the list.
// Says how many lie in it. Error(input) where none does.
Scene scene_from_points(std::span<const ColoredPoint> points, const Placement& placement, long most = 0);

// Grey ones, uniform in the cube: of a seed, always the same.
Scene random_scene(const Placement& placement, long count, std::uint64_t seed);

}  // namespace vsplat
