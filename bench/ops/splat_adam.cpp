#include "model/ops/fit/splat_adam.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> splat_adam_cases(const Options&) {
  return {
      {"harmonics",
       [](Context& ctx) {
         const Shape shape{kVoxels, kSh, 3};
         const Tensor grad = random(ctx, shape, 1);
         SplatAdam a;
         a.param = random(ctx, shape, 2), a.grad = ctx.tensor(shape), a.m = random(ctx, shape, 3);
         a.v = random(ctx, shape, 4, 0.1f, 1.0f);
         a.head = 3, a.rate_rest = 5e-5;
         return operation(ctx,
                          [&ctx, a, grad] {
                            ctx.copy(grad, a.grad);  // a step leaves zeros
                            splat_adam(ctx, a);
                          },
                          {a.param, a.m, a.v});
       }},
  };
}

}  // namespace vsplat::bench
