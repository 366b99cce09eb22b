#include "model/ops/attention.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> attention_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         AttentionForward a{random(ctx, {kViews, 1025, 3, 12, 64}, 1), ctx.tensor({kViews, 1025, kDim}),
                            ctx.tensor({kViews, 12, 1025, 2})};
         return operation(ctx, [&ctx, a] { attention_forward(ctx, a); }, {a.out, a.stats});
       }},
      {"backward",
       [](Context& ctx) {
         const AttentionForward f{random(ctx, {kViews, 1025, 3, 12, 64}, 1), ctx.tensor({kViews, 1025, kDim}),
                                  ctx.tensor({kViews, 12, 1025, 2})};
         attention_forward(ctx, f);
         AttentionBackward a{f.qkv, f.out, f.stats, random(ctx, f.out.shape(), 2), ctx.tensor(f.qkv.shape())};
         return operation(ctx, [&ctx, a] { attention_backward(ctx, a); }, {a.dqkv});
       }},
  };
}

}  // namespace vsplat::bench
