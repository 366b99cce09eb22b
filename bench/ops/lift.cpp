#include "model/ops/lift.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kMaps = kViews * kTokens * kTokens;   // rows of all views' maps
constexpr long kBlock = 8192, kFirst = kVoxels / 2;  // voxels at a time, from the middle of the volume

LiftCorners corners(Context& ctx) {
  LiftCorners a;
  a.cameras = cameras(ctx);
  a.volume = static_cast<int>(kSide), a.tokens = static_cast<int>(kTokens), a.image = static_cast<int>(kImage);
  a.first = kFirst;
  a.index = ctx.tensor({kBlock, kViews, 4}, Type::i32), a.weight = ctx.tensor({kBlock, kViews, 4});
  return a;
}

}  // namespace

std::vector<Case> lift_cases(const Options&) {
  return {
      {"corners",
       [](Context& ctx) {
         const LiftCorners a = corners(ctx);
         return operation(ctx, [&ctx, a] { lift_corners(ctx, a); }, {a.index, a.weight});
       }},
      {"variance forward",
       [](Context& ctx) {
         const LiftCorners c = corners(ctx);
         lift_corners(ctx, c);
         LiftVarianceForward a{random(ctx, {kMaps, kDim}, 1), c.index, c.weight, ctx.tensor({kBlock, kDim})};
         return operation(ctx, [&ctx, a] { lift_variance_forward(ctx, a); }, {a.out});
       }},
      {"mean forward",
       [](Context& ctx) {
         const LiftCorners c = corners(ctx);
         lift_corners(ctx, c);
         LiftMeanForward a{random(ctx, {kMaps, kDim}, 1), c.index, c.weight,
                           random(ctx, {kDim}, 2),        0,       ctx.tensor({kBlock, kDim})};
         return operation(ctx, [&ctx, a] { lift_mean_forward(ctx, a); }, {a.out});
       }},
      {"samples forward",
       [](Context& ctx) {
         const LiftCorners c = corners(ctx);
         lift_corners(ctx, c);
         LiftSamplesForward a{random(ctx, {kMaps, kDim}, 1), c.index, c.weight, ctx.tensor({kBlock, kViews, kDim})};
         return operation(ctx, [&ctx, a] { lift_samples_forward(ctx, a); }, {a.out});
       }},
      {"samples backward",
       [](Context& ctx) {
         const LiftCorners c = corners(ctx);
         lift_corners(ctx, c);
         const auto plan = std::make_shared<ScatterPlan>(make_scatter_plan(ctx, c.index, c.weight, kMaps));
         LiftSamplesBackward a{plan.get(), random(ctx, {kBlock, kViews, kDim}, 2), random(ctx, {kMaps, kDim}, 3)};
         return operation(ctx, [&ctx, a, plan] { lift_samples_backward(ctx, a); }, {a.dmaps});
       }},
      {"variance backward",
       [](Context& ctx) {
         const LiftCorners c = corners(ctx);
         lift_corners(ctx, c);
         const auto plan = std::make_shared<ScatterPlan>(make_scatter_plan(ctx, c.index, c.weight, kMaps));
         LiftVarianceBackward a{
             random(ctx, {kMaps, kDim}, 1), c.index, c.weight, plan.get(), random(ctx, {kBlock, kDim}, 2),
             random(ctx, {kMaps, kDim}, 3)};
         return operation(ctx, [&ctx, a, plan] { lift_variance_backward(ctx, a); }, {a.dmaps});
       }},
      {"mean backward",
       [](Context& ctx) {
         const LiftCorners c = corners(ctx);
         lift_corners(ctx, c);
         const auto plan = std::make_shared<ScatterPlan>(make_scatter_plan(ctx, c.index, c.weight, kMaps));
         LiftMeanBackward a{kViews, plan.get(), random(ctx, {kBlock, kDim}, 2), 0, random(ctx, {kMaps, kDim}, 3)};
         return operation(ctx, [&ctx, a, plan] { lift_mean_backward(ctx, a); }, {a.dmaps});
       }},
  };
}

}  // namespace vsplat::bench
