// Which Gaussians each tile of a picture sees, near to far.
#pragma once
#include <cstdint>

#include "model/ops/project.h"

namespace vsplat {

struct Binned {
  Tensor ids;     // u32 [N]: Gaussians, tile by tile, near to far, equal depths in their own order
  Tensor starts;  // u32 [tiles + 1]: where each tile's (row-major) run begins
};

// Intersections of tiles and Gaussians in all. Waits for the device: their number sets the size of what follows.
// A plan cannot know it: 0.
std::uint64_t count_intersections(Context& ctx, const Projected& projected);

// `count` as counted above; more than 2^31 - 1 are refused with Error(memory). Uses projected.keys as scratch.
Binned tile_bin(Context& ctx, const Projected& projected, std::uint64_t count, int width, int height);

}  // namespace vsplat
