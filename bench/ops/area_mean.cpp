#include "model/ops/render/area_mean.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> area_mean_cases(const Options&) {
  return {
      {"512 by 2",
       [](Context& ctx) {
         AreaMean a{random(ctx, {1024, 1024, 3}, 1), random(ctx, {512, 512, 3}, 2), 2};
         return operation(ctx, [&ctx, a] { area_mean(ctx, a); }, {a.out});
       }},
  };
}

}  // namespace vsplat::bench
