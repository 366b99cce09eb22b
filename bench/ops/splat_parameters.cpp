#include "model/ops/fit/splat_parameters.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

SplatParameters parameters(Context& ctx) {
  const DeviceGaussians g = random_gaussians(ctx, kVoxels, 1);
  return {g.means, random(ctx, {kVoxels, 3}, 6, -6, -4), g.quats, random(ctx, {kVoxels}, 7, -3, 3), g.sh};
}

}  // namespace

std::vector<Case> splat_parameters_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const SplatParametersForward a{parameters(ctx), {0.1f, 1, 2}, ctx.tensor({kVoxels, 3}), ctx.tensor({kVoxels})};
         return operation(ctx, [&ctx, a] { splat_parameters_forward(ctx, a); }, {a.scales, a.opacities});
       }},
      {"backward",
       [](Context& ctx) {
         const GaussianGradients given = random_gradients(ctx, kVoxels, 8);
         SplatParametersBackward a;
         a.x = parameters(ctx), a.dropping = {0.1f, 1, 2}, a.dgaussians = random_gradients(ctx, kVoxels, 13);
         a.opacity_weight = 0.01f, a.scale_weight = 0.01f;
         return operation(ctx,
                          [&ctx, a, given] {
                            ctx.copy(given.scales, a.dgaussians.scales);  // it works in place
                            ctx.copy(given.opacities, a.dgaussians.opacities);
                            splat_parameters_backward(ctx, a);
                          },
                          {a.dgaussians.scales, a.dgaussians.opacities});
       }},
  };
}

}  // namespace vsplat::bench
