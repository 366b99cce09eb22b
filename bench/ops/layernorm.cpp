#include "model/ops/dense/layernorm.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> layernorm_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         LayerNormForward a{random(ctx, {4100, kDim}, 1), random(ctx, {kDim}, 2), random(ctx, {kDim}, 3), 1e-6f,
                            ctx.tensor({4100, kDim})};
         return operation(ctx, [&ctx, a] { layernorm_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         LayerNormBackward a;
         a.x = random(ctx, {4100, kDim}, 1), a.gamma = random(ctx, {kDim}, 2);
         a.dy = random(ctx, {4100, kDim}, 3), a.dx = ctx.tensor({4100, kDim});
         a.dgamma = random(ctx, {kDim}, 4), a.dbeta = random(ctx, {kDim}, 5);
         return operation(ctx, [&ctx, a] { layernorm_backward(ctx, a); }, {a.dx, a.dgamma, a.dbeta});
       }},
      {"modulate forward",
       [](Context& ctx) {
         ModulateForward a{random(ctx, {kViews, 1025, kDim}, 1),
                           random(ctx, {kDim}, 2),
                           random(ctx, {kDim}, 3),
                           random(ctx, {kViews, 1024, 2 * kDim}, 4),
                           1e-6f,
                           ctx.tensor({kViews, 1024, kDim})};
         return operation(ctx, [&ctx, a] { modulate_forward(ctx, a); }, {a.out});
       }},
      {"modulate backward",
       [](Context& ctx) {
         ModulateBackward a;
         a.x = random(ctx, {kViews, 1025, kDim}, 1), a.gamma = random(ctx, {kDim}, 2), a.beta = random(ctx, {kDim}, 3);
         a.film = random(ctx, {kViews, 1024, 2 * kDim}, 4), a.dy = random(ctx, {kViews, 1024, kDim}, 5);
         a.dx = ctx.tensor(a.x.shape()), a.dfilm = ctx.tensor(a.film.shape());
         a.dgamma = random(ctx, {kDim}, 6), a.dbeta = random(ctx, {kDim}, 7);
         return operation(ctx, [&ctx, a] { modulate_backward(ctx, a); }, {a.dx, a.dfilm, a.dgamma, a.dbeta});
       }},
  };
}

}  // namespace vsplat::bench
