// VGG's first layer, of a picture of 224 x 224.
#include "model/ops/fit/lpips.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> lpips_cases(const Options&) {
  return {
      {"map",
       [](Context& ctx) {
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx,
             [&ctx, out] {
               *out = picture_map(ctx, 224, 224, {3, 1, 1});
             },
             [out] { return std::vector{*out}; });
       }},
      {"relu",
       [](Context& ctx) {
         const Tensor x = random(ctx, {224, 224, 64}, 1);
         return operation(ctx, [&ctx, x] { relu(ctx, x); }, {x});
       }},
      {"max_pool",
       [](Context& ctx) {
         const Tensor x = random(ctx, {224, 224, 64}, 1);
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx,
             [&ctx, x, out] {
               *out = max_pool(ctx, x, {2, 2, 0});
             },
             [out] { return std::vector{*out}; });
       }},
      {"distance",
       [](Context& ctx) {
         FeatureDistance a{random(ctx, {224, 224, 64}, 1), random(ctx, {224, 224, 64}, 2), random(ctx, {64}, 3, 0, 1),
                           ctx.tensor({224, 224})};
         return operation(ctx, [&ctx, a] { feature_distance(ctx, a); }, {a.out});
       }},
  };
}

}  // namespace vsplat::bench
