// Rays of six numbers, a direction and a moment of any length, in the network's format: spherical harmonics to degree
// 3. For cameras' rays see plucker.h.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct RayHarmonicsForward {
  Tensor rays;  // [R, 6]
  Tensor out;   // [R, 32]
};
void ray_harmonics_forward(Context& ctx, const RayHarmonicsForward& a);

struct RayHarmonicsBackward {
  Tensor rays;   // [R, 6], as in the forward
  Tensor dout;   // [R, 32]
  Tensor drays;  // [R, 6]; written
};
void ray_harmonics_backward(Context& ctx, const RayHarmonicsBackward& a);

}  // namespace vsplat
