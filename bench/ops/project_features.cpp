#include "model/ops/networks/project_features.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

ProjectFeaturesForward forward(Context& ctx, const DeviceCameras& cameras) {
  ProjectFeaturesForward a;
  a.features = random(ctx, {kViews, kTokens, kTokens, kDim}, 1);
  a.points = selected_centres(ctx);
  a.cameras = &cameras;
  a.image = static_cast<int>(kImage);
  a.out = ctx.tensor({kSelected, kDim});
  return a;
}

}  // namespace

std::vector<Case> project_features_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const auto views = std::make_shared<DeviceCameras>(cameras(ctx));
         const ProjectFeaturesForward a = forward(ctx, *views);
         return operation(ctx, [&ctx, a, views] { project_features_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         const auto views = std::make_shared<DeviceCameras>(cameras(ctx));
         const ProjectFeaturesBackward a{forward(ctx, *views), random(ctx, {kSelected, kDim}, 2),
                                         random(ctx, {kViews, kTokens, kTokens, kDim}, 3),
                                         random(ctx, {kSelected, 3}, 4)};
         return operation(ctx, [&ctx, a, views] { project_features_backward(ctx, a); }, {a.dfeatures, a.dpoints});
       }},
  };
}

}  // namespace vsplat::bench
