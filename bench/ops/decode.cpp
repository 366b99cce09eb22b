#include "model/ops/networks/decode.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> decode_cases(const Options&) {
  return {
      {"coarse forward",
       [](Context& ctx) {
         DecodeCoarseForward a{random(ctx, {kVoxels, kRaw}, 1), kSide, make_gaussians(ctx, kVoxels, kSh, "bench")};
         return operation(ctx, [&ctx, a] { decode_coarse_forward(ctx, a); },
                          {a.out.means, a.out.scales, a.out.quats, a.out.opacities, a.out.sh});
       }},
      {"coarse backward",
       [](Context& ctx) {
         DecodeCoarseBackward a{random(ctx, {kVoxels, kRaw}, 1), kSide, random_gradients(ctx, kVoxels, 2),
                                ctx.tensor({kVoxels, kRaw})};
         return operation(ctx, [&ctx, a] { decode_coarse_backward(ctx, a); }, {a.draw});
       }},
      {"fine forward",
       [](Context& ctx) {
         DecodeFineForward a{random(ctx, {kSelected, kFine * kRaw}, 1), selected_centres(ctx),
                             random(ctx, {kFine, 3}, 2), kSide, make_gaussians(ctx, kSelected * kFine, kSh, "bench")};
         return operation(ctx, [&ctx, a] { decode_fine_forward(ctx, a); },
                          {a.out.means, a.out.scales, a.out.quats, a.out.opacities, a.out.sh});
       }},
      {"fine backward",
       [](Context& ctx) {
         DecodeFineBackward a{random(ctx, {kSelected, kFine * kRaw}, 1), kSide,
                              random_gradients(ctx, kSelected * kFine, 2), ctx.tensor({kSelected, kFine * kRaw}),
                              random(ctx, {kSelected, 3}, 7)};
         return operation(ctx, [&ctx, a] { decode_fine_backward(ctx, a); }, {a.draw, a.dcentres});
       }},
      {"points forward",
       [](Context& ctx) {
         DecodePointsForward a{random(ctx, {kVoxels, kRaw - 3}, 1), random(ctx, {kVoxels, 3}, 2), 0.001, 0,
                               make_gaussians(ctx, kVoxels, kSh, "bench")};
         return operation(ctx, [&ctx, a] { decode_points_forward(ctx, a); }, {a.out.scales, a.out.sh});
       }},
      {"points backward",
       [](Context& ctx) {
         DecodePointsBackward a{random(ctx, {kVoxels, kRaw - 3}, 1),
                                0.001,
                                0,
                                random_gradients(ctx, kVoxels, 2),
                                ctx.tensor({kVoxels, kRaw - 3}),
                                ctx.tensor({kVoxels, 3})};
         return operation(ctx, [&ctx, a] { decode_points_backward(ctx, a); }, {a.draw, a.dpoints});
       }},
      {"adjusted forward",
       [](Context& ctx) {
         DecodeAdjustedForward a{random(ctx, {kSelected, 3 * kSh + 1}, 1), random_gaussians(ctx, kSelected, 2), 0,
                                 make_gaussians(ctx, kSelected, kSh, "bench")};
         return operation(ctx, [&ctx, a] { decode_adjusted_forward(ctx, a); }, {a.out.opacities, a.out.sh});
       }},
      {"adjusted backward",
       [](Context& ctx) {
         DecodeAdjustedBackward a{random(ctx, {kSelected, 3 * kSh + 1}, 1),
                                  random(ctx, {kSelected}, 2, 0.1f, 0.9f),
                                  0,
                                  random_gradients(ctx, kSelected, 3),
                                  ctx.tensor({kSelected, 3 * kSh + 1}),
                                  random_gradients(ctx, kSelected, 8)};
         return operation(ctx, [&ctx, a] { decode_adjusted_backward(ctx, a); }, {a.draw, a.dskeleton.opacities});
       }},
  };
}

}  // namespace vsplat::bench
