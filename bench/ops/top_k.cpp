#include "model/ops/volume/top_k.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

// GenDen's choice of 12,000, of as many as may be kept of 64^3.
std::vector<Case> top_k_cases(const Options&) {
  return {{"largest", [](Context& ctx) {
             constexpr long count = 100000;
             const TopK a{random(ctx, {count}, 1), 12000, ctx.tensor({count}, Type::u32), {}};
             return operation(ctx, [&ctx, a] { top_k(ctx, a); }, {a.flags});
           }}};
}

}  // namespace vsplat::bench
