// Projection's derivative: gradients of the Gaussians, and of the camera's pose.
#pragma once
#include "model/ops/project.h"
#include "model/ops/rasterize_backward.h"

namespace vsplat {

// A loss's derivatives by Gaussians, shaped as they are.
struct GaussianGradients {
  Tensor means;      // f32 [K,3]
  Tensor scales;     // f32 [K,3]
  Tensor quats;      // f32 [K,4], by the quaternions as given, of whatever length
  Tensor opacities;  // f32 [K]
  Tensor sh;         // f32 [K,S,3]
};
GaussianGradients zero_gradients(Context& ctx, const DeviceGaussians& gaussians);

// The N visible Gaussians of a view, and their intersections with tiles.
struct VisibleGaussians {
  Tensor ids;      // u32 [N]: which Gaussian each is
  Tensor records;  // f32 [N,12]
  Tensor offsets;  // u32 [N+1]: where each one's rows begin
  IntersectionGradients intersections;
};

// Adds to `out`. `view` of upload_views' [V,32], `mirrored` where those were given a mirror point. Returns, where
// `pose` is asked for, f32 [6]: by (omega, tau) at 0, where the pose is exp([omega, tau]) times world to camera; else
// none.
Tensor project_backward(Context& ctx, const DeviceGaussians& gaussians, const Tensor& views, long view, bool mirrored,
                        const VisibleGaussians& visible, const GaussianGradients& out, bool pose);

}  // namespace vsplat
