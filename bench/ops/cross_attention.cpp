#include "model/ops/dense/cross_attention.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

// LaRa's windows: 16^3 cells of 8 voxels, which look at 4 views' features.
constexpr long kCells = 4096, kQueries = 8, kChannels = 256, kHeads = 16;

CrossAttentionForward windows(Context& ctx) {
  const Shape queries{kCells * kQueries, kChannels}, keys{kCells * kViews, kChannels};
  return {random(ctx, queries, 1),
          random(ctx, keys, 2),
          random(ctx, keys, 3),
          kHeads,
          {{}, {}, kQueries, kViews},
          ctx.tensor(queries),
          ctx.tensor({kCells * kQueries, kHeads})};
}

}  // namespace

std::vector<Case> cross_attention_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const CrossAttentionForward a = windows(ctx);
         return operation(ctx, [&ctx, a] { cross_attention_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         const CrossAttentionForward f = windows(ctx);
         cross_attention_forward(ctx, f);
         const CrossAttentionBackward a{f.q,
                                        f.k,
                                        f.v,
                                        f.heads,
                                        f.groups,
                                        f.out,
                                        f.stats,
                                        random(ctx, f.q.shape(), 4),
                                        ctx.tensor(f.q.shape()),
                                        ctx.tensor(f.k.shape()),
                                        ctx.tensor(f.k.shape())};
         return operation(ctx, [&ctx, a] { cross_attention_backward(ctx, a); }, {a.dq, a.dk, a.dv});
       }},
  };
}

}  // namespace vsplat::bench
