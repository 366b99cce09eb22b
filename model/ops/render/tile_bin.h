// Which Gaussians each tile of a part of a picture sees, near to far.
#pragma once
#include <cstdint>

#include "model/ops/render/visible.h"

namespace vsplat {

struct Binned {
  Tensor ids;      // u32 [N], the first starts[tiles] of them: of the V projected Gaussians, tile by tile, near to far,
                   // equal depths in their own order
  Tensor starts;   // u32 [tiles + 1]: where each tile's (row-major) run begins
  Tensor offsets;  // u32 [V+1], if asked for: where each Gaussian's run of slots begins
  Tensor slots;    // u32 [N], if asked for: the place of each of `ids` when the pairs are ordered by Gaussian
};

struct BinOptions {
  bool slots = false;  // whether offsets and slots are wanted, for a backward
  // Whether the tiles of a Gaussian's rectangle in which its alpha stays below 1/255 are left out; of thin, slanted
  // Gaussians that is most of them. It changes no picture, since nothing below 1/255 is drawn.
  bool exact = false;
};

// count: the number of pairs, from count_visible; with `exact` there are at most that many. Overwrites projected.keys.
Binned tile_bin(Context& ctx, const Projected& projected, std::uint64_t count, const Part& part,
                const BinOptions& options = {});

}  // namespace vsplat
