// Which object and which of its views a training step takes: by chance, and the same for the same numbers.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "model/data/random.h"

namespace vsplat {

// Where `index` (below `count`) comes in an order of 0 .. count - 1 that the seed and the round decide: every number
// once a round. Takes no memory.
std::uint64_t shuffled(std::uint64_t index, std::uint64_t count, std::uint64_t seed, std::uint32_t round);

struct DrawnViews {
  std::vector<int> inputs, novel;
};

// k-means groups of the camera positions, as many as views are asked for, in random order; of each group one member at
// random: so the inputs, and apart from these so the novel views. No view twice, and none that is `excluded`, unless
// too few are left for that: then novel views may repeat. Nothing is drawn where there are fewer views than `inputs`.
DrawnViews draw_views(std::span<const Eigen::Vector3d> positions, const std::vector<bool>& excluded, int inputs,
                      int novel, Random& random);

}  // namespace vsplat
