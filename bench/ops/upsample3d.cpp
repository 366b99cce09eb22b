#include "model/ops/volume/upsample3d.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> upsample3d_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         Upsample3dForward a{random(ctx, {24 * 24 * 24, 256}, 1), 24, 24, 24, ctx.tensor({kVoxels, 256})};
         return operation(ctx, [&ctx, a] { upsample3d_forward(ctx, a); }, {a.y});
       }},
      {"backward",
       [](Context& ctx) {
         Upsample3dBackward a{random(ctx, {kVoxels, 256}, 1), 24, 24, 24, ctx.tensor({24 * 24 * 24, 256})};
         return operation(ctx, [&ctx, a] { upsample3d_backward(ctx, a); }, {a.dx});
       }},
  };
}

}  // namespace vsplat::bench
