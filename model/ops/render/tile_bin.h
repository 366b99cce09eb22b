// The Gaussians that each tile of a part of a picture sees, near to far.
#pragma once
#include <cstdint>

#include "model/ops/render/visible.h"

namespace vsplat {

struct Binned {
  Tensor ids;      // u32 [N]; the first starts[tiles] are used: indices of the V projected Gaussians, tile by tile,
                   // near to far, equal depths in their order
  Tensor starts;   // u32 [tiles + 1]: where each tile's (row-major) run begins
  Tensor offsets;  // u32 [V+1], on request: where each Gaussian's run of slots begins
  Tensor slots;    // u32 [N], on request: the place of each of `ids` when the pairs are ordered by Gaussian
};

struct BinOptions {
  bool slots = false;  // whether to compute offsets and slots, for a backward
  // Whether to leave out the tiles of a Gaussian's rectangle in which its alpha stays below 1/255; for thin, slanted
  // Gaussians these are most tiles. Pictures do not change, since nothing below 1/255 is drawn.
  bool exact = false;
};

// count: the number of pairs, from count_visible; with `exact` there are at most that many. Overwrites projected.keys.
Binned tile_bin(Context& ctx, const Projected& projected, std::uint64_t count, const Part& part,
                const BinOptions& options = {});

}  // namespace vsplat
