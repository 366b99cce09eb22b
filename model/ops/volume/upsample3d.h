// Trilinear upsampling of volumes.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct Upsample3dForward {
  Tensor x;                               // [D*H*W, C], x slowest
  long depth = 0, height = 0, width = 0;  // D, H, W of the input
  Tensor y;                               // [2D*2H*2W, C]
};

void upsample3d_forward(Context& ctx, const Upsample3dForward& a);

struct Upsample3dBackward {
  Tensor dy;                              // [2D*2H*2W, C]
  long depth = 0, height = 0, width = 0;  // D, H, W of the forward's input
  Tensor dx;                              // [D*H*W, C]
  bool add = false;                       // dx is added to, not overwritten
};

void upsample3d_backward(Context& ctx, const Upsample3dBackward& a);

}  // namespace vsplat
