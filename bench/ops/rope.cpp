#include "model/ops/dense/rope.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

// DINOv3's ViT-B/16: a class token and four registers.
Tensor queries(Context& ctx) { return random(ctx, {kViews, 5 + kTokens * kTokens, 3, 12, 64}, 1); }
Tensor turns(Context& ctx) {
  return ctx.upload({kTokens * kTokens, 32, 2}, rope_turns(kTokens, kTokens, 64, 100, false));
}

}  // namespace

std::vector<Case> rope_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         RopeForward a{queries(ctx), turns(ctx)};
         return operation(ctx, [&ctx, a] { rope_forward(ctx, a); }, {a.qkv});
       }},
      {"backward",
       [](Context& ctx) {
         RopeBackward a{queries(ctx), turns(ctx)};
         return operation(ctx, [&ctx, a] { rope_backward(ctx, a); }, {a.dqkv});
       }},
  };
}

}  // namespace vsplat::bench
