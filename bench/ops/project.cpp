#include "model/ops/render/project.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {

std::vector<Case> project_cases(const Options&) {
  return {
      {"cull",
       [](Context& ctx) {
         const Drawing d(ctx);
         return operation(ctx,
                          [&ctx, d] { project_cull(ctx, d.gaussians, 0, d.views, 0, d.width, d.height, d.culled); },
                          {d.culled.rects, d.culled.keys});
       }},
      {"forward",
       [](Context& ctx) {
         const Drawing d(ctx);
         const ProjectForward a = d.project_all();
         return operation(ctx, [&ctx, a] { project_forward(ctx, a); }, {a.records});
       }},
      {"backward",
       [](Context& ctx) {
         const Drawing d(ctx);
         const Binned binned = d.bin(ctx, true);
         ProjectBackward a;
         a.chunk = d.gaussians, a.views = d.views, a.visible = d.projected, a.offsets = binned.offsets;
         a.intersections = rasterize_backward(ctx, d.blend_backward(ctx, binned));
         a.dchunk = zero_gradients(ctx, d.gaussians.count(), d.gaussians.sh_degree());
         a.pose_gradients = ctx.tensor({d.projected.ids.dim(0), 6});
         return operation(ctx, [&ctx, a] { project_backward(ctx, a); },
                          {a.dchunk.means, a.dchunk.sh, a.pose_gradients});
       }},
      {"pulls",
       [](Context& ctx) {
         const Drawing d(ctx);
         const Binned binned = d.bin(ctx, true);
         RasterizeBackward blend = d.blend_backward(ctx, binned);
         blend.pulls = Pulls::through;
         const ProjectPulls a{d.projected,
                              binned.offsets,
                              rasterize_backward(ctx, blend),
                              256,
                              256,
                              random(ctx, {d.gaussians.count(), 2}, 1, 0.0f, 1.0f)};
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx,
             [&ctx, a, out] {
               project_pulls(ctx, a);
               *out = pull_lengths(ctx, a.pulls);
             },
             [out] { return std::vector{*out}; });
       }},
      {"sum_pose_gradients",
       [](Context& ctx) {
         const Tensor pose_gradients = random(ctx, {kVoxels, 6}, 1), copied = ctx.tensor({kVoxels, 6});
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx,
             [&ctx, pose_gradients, copied, out] {
               ctx.copy(pose_gradients, copied);
               *out = sum_pose_gradients(ctx, copied);
             },
             [out] { return std::vector{*out}; });
       }},
  };
}

}  // namespace vsplat::bench
