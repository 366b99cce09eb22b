#include "model/ops/dense/add_columns.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> add_columns_cases(const Options&) {
  return {
      {"features",
       [](Context& ctx) {
         AddColumns a{random(ctx, {kSelected, kDim}, 1), random(ctx, {kSelected, kDim + 191}, 2), 128};
         return operation(ctx, [&ctx, a] { add_columns(ctx, a); }, {a.out});
       }},
  };
}

}  // namespace vsplat::bench
