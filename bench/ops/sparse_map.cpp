#include "model/ops/volume/sparse_map.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> sparse_map_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         SparseMapForward a{selected_voxels(ctx), kSide, ctx.tensor({kSelected, 27}, Type::i32)};
         return operation(ctx, [&ctx, a] { sparse_map_forward(ctx, a); }, {a.map});
       }},
  };
}

}  // namespace vsplat::bench
