#include "model/ops/volume/sample_points.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

SamplePointsForward points(Context& ctx, const DeviceCameras& views) {
  return {random(ctx, {kViews, kImage, kImage, 8}, 1), selected_centres(ctx), &views, true,
          ctx.tensor({kSelected, kViews, 8})};
}

}  // namespace

std::vector<Case> sample_points_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const auto views = std::make_shared<DeviceCameras>(cameras(ctx));
         const SamplePointsForward a = points(ctx, *views);
         return operation(ctx, [&ctx, a, views] { sample_points_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         const auto views = std::make_shared<DeviceCameras>(cameras(ctx));
         SamplePointsBackward a{points(ctx, *views), random(ctx, {kSelected, kViews, 8}, 2),
                                random(ctx, {kSelected, 3}, 3), random(ctx, {kViews, kImage, kImage, 8}, 4)};
         return operation(ctx, [&ctx, a, views] { sample_points_backward(ctx, a); }, {a.dpoints, a.dmaps});
       }},
  };
}

}  // namespace vsplat::bench
