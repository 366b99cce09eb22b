#include "model/ops/dense/groupnorm.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kChannels = 128;

GroupNormForward forward(Context& ctx) {
  GroupNormForward a;
  a.x0 = random(ctx, {kVoxels, kChannels}, 1);
  a.gamma = random(ctx, {kChannels}, 2, 0.5f, 2.0f), a.beta = random(ctx, {kChannels}, 3);
  a.groups = 16;
  for (Tensor* t : {&a.scale, &a.shift, &a.mean, &a.rstd}) *t = ctx.tensor({kChannels});
  return a;
}

}  // namespace

std::vector<Case> groupnorm_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const GroupNormForward a = forward(ctx);
         return operation(ctx, [&ctx, a] { groupnorm_forward(ctx, a); }, {a.scale, a.shift, a.mean, a.rstd});
       }},
      {"backward",
       [](Context& ctx) {
         const GroupNormForward f = forward(ctx);
         groupnorm_forward(ctx, f);
         GroupNormBackward a;
         a.x0 = f.x0, a.gamma = f.gamma, a.groups = f.groups;
         a.scale = f.scale, a.shift = f.shift, a.mean = f.mean, a.rstd = f.rstd;
         a.dy = random(ctx, f.x0.shape(), 4), a.dx0 = ctx.tensor(f.x0.shape());
         a.dgamma = random(ctx, {kChannels}, 5), a.dbeta = random(ctx, {kChannels}, 6);
         return operation(ctx, [&ctx, a] { groupnorm_backward(ctx, a); }, {a.dx0, a.dgamma, a.dbeta});
       }},
  };
}

}  // namespace vsplat::bench
