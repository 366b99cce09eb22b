// The part of a training loss on surfels' surface: forward and backward in one call, as in loss.h for pictures.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct SurfaceWeights {
  float distortion = 0, normal = 0;
  bool any() const { return distortion > 0 || normal > 0; }
};

// `distortion` times the mean distortion, plus `normal` times the mean of alpha (1 - normal . depth_normal), where
// alpha counts as constant. Never waits; every run gives the same bits.
struct SurfaceLoss {
  Tensor normal, depth_normal;  // [H,W,3], see LaraMaps
  Tensor alpha, distortion;     // [H,W]
  SurfaceWeights weights;
  Tensor value;                                // its first number is added to
  Tensor dnormal, ddepth_normal, ddistortion;  // written: the loss by the maps, multiplied by
  float gradient_scale = 1;
};
void surface_loss(Context& ctx, const SurfaceLoss& a);

}  // namespace vsplat
