#include "model/ops/fit/depth_loss.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> depth_loss_cases(const Options&) {
  const auto make = [](DepthKind kind) {
    return [kind](Context& ctx) {
      const auto picture = [&](std::uint32_t seed, float low) { return random(ctx, {kImage, kImage}, seed, low, 1); };
      DepthLoss a;
      a.drawn.depth = picture(1, 0.5f), a.drawn.alpha = picture(2, 0.1f), a.given = picture(3, 0.1f);
      a.kind = kind, a.weight = 0.1f, a.known = kImage * kImage;
      a.ddepth = ctx.tensor({kImage, kImage});
      const Tensor before = picture(4, 0);
      a.dalpha = ctx.tensor({kImage, kImage});
      return operation(ctx,
                       [&ctx, a, before] {
                         ctx.copy(before, a.dalpha);  // it is added to
                         depth_loss(ctx, a);
                       },
                       {a.ddepth, a.dalpha});
    };
  };
  return {{"metric", make(DepthKind::metric)}, {"inverse", make(DepthKind::inverse)}};
}

}  // namespace vsplat::bench
