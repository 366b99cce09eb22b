// Four pictures of 256 x 256, as a training compares them.
#include "model/ops/fit/loss.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> loss_cases(const Options&) {
  return {
      {"pictures",
       [](Context& ctx) {
         PictureLoss a;
         a.pictures = random(ctx, {kViews, 256, 256, 3}, 1, 0, 1),
         a.target = random(ctx, {kViews, 256, 256, 3}, 2, 0, 1);
         a.out = ctx.tensor({3}), a.dpictures = ctx.tensor(a.pictures.shape());
         return operation(ctx, [&ctx, a] { picture_loss(ctx, a); }, {a.out, a.dpictures});
       }},
  };
}

}  // namespace vsplat::bench
