#include "model/ops/networks/ray_harmonics.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> ray_harmonics_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         RayHarmonicsForward a{random(ctx, {kViews * kTokens * kTokens, 6}, 1),
                               ctx.tensor({kViews * kTokens * kTokens, 32})};
         return operation(ctx, [&ctx, a] { ray_harmonics_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         RayHarmonicsBackward a{random(ctx, {kViews * kTokens * kTokens, 6}, 1),
                                random(ctx, {kViews * kTokens * kTokens, 32}, 2),
                                ctx.tensor({kViews * kTokens * kTokens, 6})};
         return operation(ctx, [&ctx, a] { ray_harmonics_backward(ctx, a); }, {a.drays});
       }},
  };
}

}  // namespace vsplat::bench
