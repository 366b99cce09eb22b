#include "model/ops/fit/exposure.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> exposure_cases(const Options&) {
  struct Data {
    Tensor map, out, dmap;
    DevicePicture drawn;
    PictureGradient by;
  };
  const auto make = [](Context& ctx) {
    // The backward turns the gradient by it in place, again and again.
    const std::vector<float> none{1, 0, 0, 0, 1, 0, 0, 0, 1, 0.1f, 0.1f, 0.1f};
    Data d;
    d.map = ctx.upload({12}, none), d.dmap = ctx.tensor({12}), d.out = ctx.tensor({kImage, kImage, 3});
    d.drawn = {random(ctx, {kImage, kImage, 3}, 2, 0, 1), random(ctx, {kImage, kImage}, 3, 0, 1), {}};
    d.by = {random(ctx, {kImage, kImage, 3}, 4), random(ctx, {kImage, kImage}, 5), {}};
    return d;
  };
  return {
      {"forward",
       [make](Context& ctx) {
         const Data d = make(ctx);
         return operation(ctx, [&ctx, d] { exposure_forward(ctx, {d.map, d.drawn, {1, 1, 1}, d.out}); }, {d.out});
       }},
      {"backward",
       [make](Context& ctx) {
         const Data d = make(ctx);
         return operation(ctx,
                          [&ctx, d] {
                            exposure_backward(ctx, {d.map, d.drawn, {1, 1, 1}, d.by, d.dmap});
                          },
                          {d.dmap});
       }},
  };
}

}  // namespace vsplat::bench
