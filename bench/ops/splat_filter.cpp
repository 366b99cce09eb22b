#include "model/ops/fit/splat_filter.h"

#include "bench/ops/operation.h"
#include "model/ops/render/project.h"

namespace vsplat::bench {

std::vector<Case> splat_filter_cases(const Options&) {
  return {
      {"variances",
       [](Context& ctx) {
         const SplatFilterVariances a{random(ctx, {kVoxels, 3}, 1, -0.5f, 0.5f),
                                      upload_views(ctx, orbit_cameras(), 0.2f, {}), ctx.tensor({kVoxels})};
         return operation(ctx, [&ctx, a] { splat_filter_variances(ctx, a); }, {a.variances});
       }},
      {"forward",
       [](Context& ctx) {
         const Tensor scales = random(ctx, {kVoxels, 3}, 1, 0.01f, 0.1f),
                      opacities = random(ctx, {kVoxels}, 2, 0.1f, 1);
         const SplatFilterForward a{random(ctx, {kVoxels}, 3, 0, 0.01f), ctx.tensor({kVoxels, 3}),
                                    ctx.tensor({kVoxels})};
         return operation(ctx,
                          [&ctx, a, scales, opacities] {
                            ctx.copy(scales, a.scales);  // it works in place
                            ctx.copy(opacities, a.opacities);
                            splat_filter_forward(ctx, a);
                          },
                          {a.scales, a.opacities});
       }},
      {"backward",
       [](Context& ctx) {
         const Tensor by_scales = random(ctx, {kVoxels, 3}, 1), by_opacities = random(ctx, {kVoxels}, 2);
         const SplatFilterBackward a{random(ctx, {kVoxels}, 3, 0, 0.01f), random(ctx, {kVoxels, 3}, 4, -5, -2),
                                     random(ctx, {kVoxels}, 5, 0, 1), ctx.tensor({kVoxels, 3}), ctx.tensor({kVoxels})};
         return operation(ctx,
                          [&ctx, a, by_scales, by_opacities] {
                            ctx.copy(by_scales, a.dscales);  // it works in place
                            ctx.copy(by_opacities, a.dopacities);
                            splat_filter_backward(ctx, a);
                          },
                          {a.dscales, a.dopacities});
       }},
  };
}

}  // namespace vsplat::bench
