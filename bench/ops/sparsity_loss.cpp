#include "model/ops/fit/sparsity_loss.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> sparsity_loss_cases(const Options&) {
  return {
      {"sparsity_loss",
       [](Context& ctx) {
         const SparsityLoss a{random(ctx, {200000}, 1), ctx.upload({200000}, std::vector<float>(200000)), 1};
         return operation(ctx, [&ctx, a] { sparsity_loss(ctx, a); }, {a.dopacities});
       }},
  };
}

}  // namespace vsplat::bench
