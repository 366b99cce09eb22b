// Chooses the object and views of a training step at random, reproducibly for the same numbers.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "model/data/random.h"

namespace vsplat {

// The position of `index` (below `count`) in a permutation of 0 .. count - 1 that seed and round determine: each number
// occurs once per round. Needs no memory.
std::uint64_t shuffled(std::uint64_t index, std::uint64_t count, std::uint64_t seed, std::uint32_t round);

struct DrawnViews {
  std::vector<int> inputs, novel;
};

// Draws input views: clusters the camera positions into as many k-means groups as views are needed, in random order,
// and takes a random member of each or, with `first`, the first of each of a random half of the views. Then draws novel
// views from the rest, a random member of each group. No view is drawn twice, and no `excluded` view at all; if too few
// are left, novel views may repeat. Draws nothing if there are fewer views than `inputs`.
DrawnViews draw_views(std::span<const Eigen::Vector3d> positions, const std::vector<bool>& excluded, int inputs,
                      int novel, bool first, Random& random);

}  // namespace vsplat
