// The Gaussians that a part of a picture sees.
#pragma once
#include <cstdint>
#include <vector>

#include "model/ops/render/project.h"

namespace vsplat {

// A rectangle of a picture's tiles, end exclusive.
struct Part {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  long tiles_x() const { return x1 - x0; }
  long tiles() const { return static_cast<long>(x1 - x0) * (y1 - y0); }
};

struct VisibleCount {
  std::uint64_t gaussians = 0;      // visible Gaussians
  std::uint64_t intersections = 0;  // pairs of one of them and a tile that it touches
  std::uint32_t least_key = 0, largest_key = 0;
  long block = 1;                     // Gaussians that `before` counts at a time: a power of two
  std::vector<std::uint64_t> before;  // [blocks + 1]: visible ones before each block
};

// Allocates project_cull's outputs for `k` Gaussians.
Culled make_culled(Context& ctx, long k);

// Waits for the device: the sizes of later tensors depend on these numbers.
VisibleCount count_visible(Context& ctx, const Culled& culled, const Part& part);

// Fills everything but the records, which are only allocated. The count must be the last one made from `culled`.
// `record`: numbers of a record.
Projected compact_visible(Context& ctx, const Culled& culled, const Part& part, const VisibleCount& count,
                          long record = kRecord);

}  // namespace vsplat
