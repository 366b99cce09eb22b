#include "model/ops/networks/ray_loss.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> ray_loss_cases(const Options&) {
  return {
      {"ray_loss",
       [](Context& ctx) {
         const Shape rays{kViews * kTokens * kTokens, 6};
         RayLoss a{random(ctx, rays, 1), random(ctx, rays, 2), ctx.tensor({1}), ctx.tensor(rays)};
         return operation(ctx, [&ctx, a] { ray_loss(ctx, a); }, {a.out, a.dpredicted});
       }},
  };
}

}  // namespace vsplat::bench
