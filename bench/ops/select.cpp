#include "model/ops/volume/select.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> select_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         SelectForward a;
         a.logits = random(ctx, {kVoxels}, 1), a.noise = random(ctx, {kVoxels}, 2);
         a.opacities = random(ctx, {kVoxels}, 3, 0.1f, 0.9f);
         a.factor = ctx.tensor({kVoxels}), a.refined = ctx.tensor({kVoxels}),
         a.flags = ctx.tensor({kVoxels}, Type::u32);
         return operation(ctx, [&ctx, a] { select_forward(ctx, a); }, {a.factor, a.refined, a.flags});
       }},
      {"backward",
       [](Context& ctx) {
         SelectBackward a;
         a.logits = random(ctx, {kVoxels}, 1), a.noise = random(ctx, {kVoxels}, 2);
         a.opacities = random(ctx, {kVoxels}, 3, 0.1f, 0.9f);
         a.temperature = 1;
         a.drefined = random(ctx, {kVoxels}, 4), a.dlogits = ctx.tensor({kVoxels}),
         a.dopacities = ctx.tensor({kVoxels});
         return operation(ctx, [&ctx, a] { select_backward(ctx, a); }, {a.dlogits, a.dopacities});
       }},
      {"noise",
       [](Context& ctx) {
         const Tensor noise = ctx.tensor({kVoxels});
         return operation(ctx, [&ctx, noise] { logistic_noise(ctx, noise, 1, 2, 3); }, {noise});
       }},
  };
}

}  // namespace vsplat::bench
