#include "model/ops/dense/position_resample.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kStored = 14;  // positions along an edge, of an encoder trained on 224 pixels

}  // namespace

std::vector<Case> position_resample_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         PositionResampleForward a{random(ctx, {1 + kStored * kStored, kDim}, 1), random(ctx, {kDim}, 2),
                                   static_cast<int>(kStored), static_cast<int>(kTokens),
                                   ctx.tensor({1 + kTokens * kTokens, kDim})};
         return operation(ctx, [&ctx, a] { position_resample_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         PositionResampleBackward a{random(ctx, {1 + kTokens * kTokens, kDim}, 1), static_cast<int>(kStored),
                                    static_cast<int>(kTokens), random(ctx, {1 + kStored * kStored, kDim}, 2),
                                    random(ctx, {kDim}, 3)};
         return operation(ctx, [&ctx, a] { position_resample_backward(ctx, a); }, {a.dstored, a.dclass_token});
       }},
  };
}

}  // namespace vsplat::bench
