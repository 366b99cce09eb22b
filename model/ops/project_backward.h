// Projection's derivative: gradients of the Gaussians, and of the camera's pose.
#pragma once
#include "model/ops/project.h"
#include "model/ops/rasterize_backward.h"

namespace vsplat {

// Adds to `out` what the rows of `intersections` say of a chunk of the scene, whose first Gaussian is the scene's
// `base`. `view` of upload_views' [V,32], `mirrored` where those were given a mirror point; offsets as Binned has them.
// `twists`, where it is not none: f32 [N,6], a row for each of the N visible Gaussians, of which the chunk's are
// written.
void project_backward(Context& ctx, const DeviceGaussians& chunk, long base, const Tensor& views, long view,
                      bool mirrored, const Projected& visible, const Tensor& offsets,
                      const IntersectionGradients& intersections, const GaussianGradients& out, const Tensor& twists);

// f32 [6]: by (omega, tau) at 0, where the pose is exp([omega, tau]) times world to camera.
Tensor sum_twists(Context& ctx, Tensor twists);

}  // namespace vsplat
