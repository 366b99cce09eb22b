// Removes Gaussians of a scene by where they are, how large and how opaque they are, and what is around them.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "model/base/scene.h"

namespace vsplat {

struct Box {
  Eigen::Vector3d low, high;
};

struct Sphere {
  Eigen::Vector3d centre;
  double radius = 0;
};

// What stays; lengths are in world units.
struct SceneFilter {
  std::optional<Box> box;        // means inside it, in the world
  std::optional<Sphere> sphere;  // means inside it, in the world
  double min_opacity = 0;
  double max_size = 0;            // a Gaussian's largest standard deviation; 0: any
  bool without_floaters = false;  // see floaters()
};

// Numbers of Gaussians that were removed. One that several rules remove counts with the first of them, in this order.
struct FilteredGaussians {
  std::uint64_t box = 0, sphere = 0, opacity = 0, size = 0, floaters = 0;
};

// The others keep their order. Floaters are looked for last, among what the other rules keep.
FilteredGaussians filter(Scene& scene, const SceneFilter& what);

// A floater is alone: the mean distance to its kFloaterNeighbours nearest others is more than kFloaterDistance times
// the median of that over all Gaussians, and more than kFloaterReach times its own largest standard deviation, so that
// the large and sparse Gaussians of a background stay. True for each Gaussian that is one. A scene of no more than
// kFloaterNeighbours has none.
inline constexpr int kFloaterNeighbours = 8;
inline constexpr double kFloaterDistance = 10, kFloaterReach = 3;
std::vector<bool> floaters(const Gaussians& gaussians);

}  // namespace vsplat
