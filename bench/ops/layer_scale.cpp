#include "model/ops/dense/layer_scale.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

// The wider one of a block's two.
std::vector<Case> layer_scale_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         LayerScaleForward a{random(ctx, {kDim, 4 * kDim}, 1), random(ctx, {kDim}, 2), random(ctx, {kDim}, 3),
                             ctx.tensor({kDim, 4 * kDim}), ctx.tensor({kDim})};
         return operation(ctx, [&ctx, a] { layer_scale_forward(ctx, a); }, {a.out_weight, a.out_bias});
       }},
      {"backward",
       [](Context& ctx) {
         LayerScaleBackward a{random(ctx, {kDim, 4 * kDim}, 1), random(ctx, {kDim}, 2),
                              random(ctx, {kDim}, 3),           random(ctx, {kDim, 4 * kDim}, 4),
                              random(ctx, {kDim}, 5),           random(ctx, {kDim, 4 * kDim}, 6),
                              random(ctx, {kDim}, 7),           random(ctx, {kDim}, 8)};
         return operation(ctx, [&ctx, a] { layer_scale_backward(ctx, a); }, {a.dweight, a.dbias, a.dscale});
       }},
  };
}

}  // namespace vsplat::bench
