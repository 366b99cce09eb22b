#include "model/ops/render/project_surfels.h"

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {

std::vector<Case> project_surfels_cases(const Options&) {
  return {
      {"cull",
       [](Context& ctx) {
         const SurfelDrawing d(ctx);
         return operation(ctx,
                          [&ctx, d] {
                            project_surfels_cull(ctx, d.gaussians, 0, d.views, 0, d.width, d.height,
                                                 SurfelRevision::lara, d.culled);
                          },
                          {d.culled.rects, d.culled.keys});
       }},
      {"forward",
       [](Context& ctx) {
         const SurfelDrawing d(ctx);
         const ProjectSurfelsForward a = d.project_all();
         return operation(ctx, [&ctx, a] { project_surfels_forward(ctx, a); }, {a.records});
       }},
      {"backward",
       [](Context& ctx) {
         const SurfelDrawing d(ctx);
         const Binned binned = d.bin(ctx, true);
         ProjectSurfelsBackward a;
         a.chunk = d.gaussians, a.views = d.views, a.visible = d.projected, a.offsets = binned.offsets;
         a.intersections = rasterize_surfels_backward(ctx, d.blend_backward(ctx, binned));
         a.dchunk = zero_gradients(ctx, d.gaussians.count(), d.gaussians.sh_degree(), GaussianKind::surfel);
         a.pose_gradients = ctx.tensor({d.projected.ids.dim(0), 6});
         return operation(ctx, [&ctx, a] { project_surfels_backward(ctx, a); },
                          {a.dchunk.means, a.dchunk.sh, a.pose_gradients});
       }},
  };
}

}  // namespace vsplat::bench
