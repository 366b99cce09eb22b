// One weight of the encoder's, and the norm of four of its gradients.
#include "model/ops/fit/adamw.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> adamw_cases(const Options&) {
  return {
      {"clip",
       [](Context& ctx) {
         GradientClip a;
         for (std::uint32_t i = 0; i < 4; ++i) a.grads.push_back(random(ctx, {3072, 768}, i));
         a.out = ctx.tensor({2});
         return operation(ctx, [&ctx, a] { gradient_clip(ctx, a); }, {a.out});
       }},
      {"step",
       [](Context& ctx) {
         AdamwStep a;
         a.param = random(ctx, {3072, 768}, 1), a.grad = random(ctx, {3072, 768}, 2);
         a.m = random(ctx, {3072, 768}, 3), a.v = random(ctx, {3072, 768}, 4, 0.1f, 1.0f);
         return operation(ctx, [&ctx, a] { adamw_step(ctx, a); }, {a.param, a.m, a.v});
       }},
      {"average",
       [](Context& ctx) {
         const Tensor average = random(ctx, {3072, 768}, 1), param = random(ctx, {3072, 768}, 2);
         return operation(ctx, [&ctx, average, param] { average_step(ctx, average, param, 0.999); }, {average});
       }},
  };
}

}  // namespace vsplat::bench
