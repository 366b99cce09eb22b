// Scenes to start a fit from when no network has made one.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "model/base/point_tree.h"
#include "model/base/scene.h"
#include "model/io/views/colmap_points.h"
#include "model/views/photographs.h"
#include "model/views/placement.h"

namespace vsplat {

// Default number of Gaussians of a random start.
inline constexpr long kRandomStart = 5000;

struct StartPoints {
  PointRows positions;  // about the placement's centre, in units of its edge
  std::vector<std::array<float, 3>> colours;
};

// Isotropic Gaussians in the world, with opacity 0.5 and without view-dependent colour. The standard deviation of each
// is the mean distance to its three nearest neighbours, at least 1e-4 of the edge and at most `high` of the edge, or of
// its distance from the centre if that is longer. `near`: the scene's near plane, in world units.
Scene isotropic_scene(const StartPoints& points, const Placement& placement, double near, double high);

// The next two return such Gaussians in an object's cube; `high` is 0.1.

// Uses the points inside the cube, with their colours. `most` above 0 limits their number, spread evenly over the list.
// Logs how many points lie in the cube. Error(input) if none does.
Scene scene_from_points(std::span<const ColoredPoint> points, const Placement& placement, long most = 0);

// Gaussians at random places of the cube that `views` show: in at least half of the pictures, and on the object in each
// picture with a mask that has the place in it. Their colours are the mean of what the pictures show there. If such
// places are rare, fewer than `count`; if there are none, anywhere in the cube and grey. Equal arguments give equal
// scenes.
Scene random_scene(const Placement& placement, long count, std::uint64_t seed, const Photographs& photographs,
                   const std::vector<int>& views);

}  // namespace vsplat
