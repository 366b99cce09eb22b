#include "model/ops/networks/plucker.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> plucker_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         PluckerForward a{cameras(ctx), static_cast<int>(kPatch), ctx.tensor({kViews, kTokens, kTokens, 32})};
         return operation(ctx, [&ctx, a] { plucker_forward(ctx, a); }, {a.out});
       }},
  };
}

}  // namespace vsplat::bench
