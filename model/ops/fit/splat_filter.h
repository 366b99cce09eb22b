// The 3D filter of Mip-Splatting: no Gaussian is finer than what the pictures can show. Each has a variance v that is
// added to those along its axes; its opacity is multiplied by the square root of its covariance's determinant before
// over after that.
#pragma once
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

// v = (0.2 / nu)^2, nu being the largest focal length over depth, in pixels per unit, among the cameras that see the
// Gaussian's middle; 0 if none does. `views`: upload_views' [V,32].
struct SplatFilterVariances {
  Tensor means;      // f32 [K,3]
  Tensor views;      // f32 [V,32]
  Tensor variances;  // f32 [K], written
};
void splat_filter_variances(Context& ctx, const SplatFilterVariances& a);

// Filters in place.
struct SplatFilterForward {
  Tensor variances;  // f32 [K]
  Tensor scales;     // f32 [K,3], above 0
  Tensor opacities;  // f32 [K]
};
void splat_filter_forward(Context& ctx, const SplatFilterForward& a);

// Turns gradients by filtered scales and opacities into those by the unfiltered ones, in place.
struct SplatFilterBackward {
  Tensor variances;   // f32 [K]
  Tensor log_scales;  // f32 [K,3], of the unfiltered scales
  Tensor opacities;   // f32 [K], filtered
  Tensor dscales;     // f32 [K,3]
  Tensor dopacities;  // f32 [K]
};
void splat_filter_backward(Context& ctx, const SplatFilterBackward& a);

}  // namespace vsplat
