// GenDen's first level: 24,000 points.
#include "model/ops/networks/confidence.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kSurePoints = 24000, kSureChannels = 256;

Case confidence_of(const char* name, bool softmax) {
  return {name, [softmax](Context& ctx) {
            const ConfidenceForward a{random(ctx, {kSurePoints}, 1), softmax, ctx.tensor({kSurePoints})};
            return operation(ctx, [&ctx, a] { confidence_forward(ctx, a); }, {a.confidence});
          }};
}

}  // namespace

std::vector<Case> confidence_cases(const Options&) {
  return {
      confidence_of("sigmoid", false),
      confidence_of("softmax", true),
      {"backward",
       [](Context& ctx) {
         const ConfidenceBackward a{random(ctx, {kSurePoints, kSureChannels}, 1),
                                    random(ctx, {kSurePoints}, 2, 0.1f, 0.9f),
                                    true,
                                    random(ctx, {kSurePoints, kSureChannels}, 3),
                                    ctx.tensor({kSurePoints, kSureChannels}),
                                    ctx.tensor({kSurePoints})};
         return operation(ctx, [&ctx, a] { confidence_backward(ctx, a); }, {a.dx, a.dlogits});
       }},
  };
}

}  // namespace vsplat::bench
