#include "model/ops/fit/sky_background.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> sky_background_cases(const Options&) {
  struct Data {
    Tensor sh, view, out, dsh;
    DevicePicture drawn;
    PictureGradient by;
  };
  const auto make = [](Context& ctx) {
    Camera camera;
    camera.width = camera.height = static_cast<int>(kImage);
    camera.fx = camera.fy = static_cast<double>(kImage), camera.cx = camera.cy = 0.5 * static_cast<double>(kImage);
    Data d;
    d.sh = random(ctx, {kSkyBasis, 3}, 1), d.dsh = ctx.tensor({kSkyBasis, 3}), d.out = ctx.tensor({kImage, kImage, 3});
    d.view = upload_views(ctx, {camera}, 0.2f, {});
    d.drawn = {random(ctx, {kImage, kImage, 3}, 2, 0, 1), random(ctx, {kImage, kImage}, 3, 0, 1), {}};
    d.by = {random(ctx, {kImage, kImage, 3}, 4), random(ctx, {kImage, kImage}, 5), {}};
    return d;
  };
  return {
      {"forward",
       [make](Context& ctx) {
         const Data d = make(ctx);
         return operation(ctx, [&ctx, d] { sky_background_forward(ctx, {d.sh, d.view, d.drawn, d.out}); }, {d.out});
       }},
      {"backward",
       [make](Context& ctx) {
         const Data d = make(ctx);
         return operation(ctx,
                          [&ctx, d] {
                            sky_background_backward(ctx, {d.sh, d.view, d.drawn, d.by, d.dsh});
                          },
                          {d.dsh});
       }},
  };
}

}  // namespace vsplat::bench
