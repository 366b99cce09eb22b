#include "model/ops/networks/position_encoding.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> position_encoding_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         PositionEncodingForward a{selected_centres(ctx), ctx.tensor({kSelected, kPositionEncoding})};
         return operation(ctx, [&ctx, a] { position_encoding_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         PositionEncodingBackward a{selected_centres(ctx), random(ctx, {kSelected, kPositionEncoding}, 1),
                                    random(ctx, {kSelected, 3}, 2)};
         return operation(ctx, [&ctx, a] { position_encoding_backward(ctx, a); }, {a.dpoints});
       }},
  };
}

}  // namespace vsplat::bench
