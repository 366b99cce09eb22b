// LaRa's maps, from the maps that surfels were drawn into, with their derivative.
#pragma once
#include "model/ops/render/rasterize.h"

namespace vsplat {

struct LaraMaps {
  Tensor image;         // f32 [H,W,3]: colour, clamped to [0, 1]
  Tensor depth;         // f32 [H,W]: divided by alpha, 0 where alpha is 0
  Tensor normal;        // f32 [H,W,3]: of the surfels, in the world's axes
  Tensor depth_normal;  // f32 [H,W,3]: of the surface that neighbouring depths span, in the world's axes, times alpha
};

struct LaraMapsForward {
  DevicePicture picture;  // with its normals
  Tensor views;           // [V,32]
  long view = 0;
};
LaraMaps lara_maps_forward(Context& ctx, const LaraMapsForward& a);

// A loss's derivatives by these maps, and by the unchanged alpha and distortion; each may be none: zeros.
struct LaraMapsGradient {
  Tensor image, alpha, depth, normal, depth_normal, distortion;
};

struct LaraMapsBackward {
  DevicePicture picture;
  Tensor views;
  long view = 0;
  LaraMapsGradient dmaps;
};
// Gradients by the picture's maps on which the loss depends. The alpha factor of depth_normal counts as constant.
PictureGradient lara_maps_backward(Context& ctx, const LaraMapsBackward& a);

}  // namespace vsplat
