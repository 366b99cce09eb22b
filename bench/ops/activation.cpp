#include "model/ops/dense/activation.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> activation_cases(const Options&) {
  return {
      {"gelu forward",
       [](Context& ctx) {
         ActivationForward a{random(ctx, {4100, 3072}, 1, -3, 3), Activation::gelu, ctx.tensor({4100, 3072})};
         return operation(ctx, [&ctx, a] { activation_forward(ctx, a); }, {a.out});
       }},
      {"gelu backward",
       [](Context& ctx) {
         ActivationBackward a{random(ctx, {4100, 3072}, 1, -3, 3), Activation::gelu, random(ctx, {4100, 3072}, 2),
                              ctx.tensor({4100, 3072})};
         return operation(ctx, [&ctx, a] { activation_backward(ctx, a); }, {a.dx});
       }},
  };
}

}  // namespace vsplat::bench
