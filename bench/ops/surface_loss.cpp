#include "model/ops/fit/surface_loss.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> surface_loss_cases(const Options&) {
  return {{"surface_loss", [](Context& ctx) {
             const Shape maps{kImage, kImage, 3}, map{kImage, kImage};
             SurfaceLoss a;
             a.normal = random(ctx, maps, 1), a.depth_normal = random(ctx, maps, 2);
             a.alpha = random(ctx, map, 3, 0, 1), a.distortion = random(ctx, map, 4, 0, 0.01f);
             a.weights = {1000, 0.2f};
             a.value = ctx.tensor({3}, Type::f32, "value");
             ctx.fill_zero(a.value);
             a.dnormal = ctx.tensor(maps, Type::f32, "dnormal");
             a.ddepth_normal = ctx.tensor(maps, Type::f32, "ddepth_normal");
             a.ddistortion = ctx.tensor(map, Type::f32, "ddistortion");
             return operation(ctx, [&ctx, a] { surface_loss(ctx, a); },
                              {a.value, a.dnormal, a.ddepth_normal, a.ddistortion});
           }}};
}

}  // namespace vsplat::bench
