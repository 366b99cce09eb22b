#include "model/ops/dense/transpose.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

// LaRa's volume, as it is stored.
std::vector<Case> transpose_cases(const Options&) {
  return {
      {"transpose",
       [](Context& ctx) {
         Transpose a{random(ctx, {256, 32768}, 1), ctx.tensor({32768, 256})};
         return operation(ctx, [&ctx, a] { transpose(ctx, a); }, {a.out});
       }},
  };
}

}  // namespace vsplat::bench
