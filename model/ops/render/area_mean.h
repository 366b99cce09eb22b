// Shrinks pictures by an integer factor.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Each value of `out` is the mean over k x k pixels of `x`.
struct AreaMean {
  Tensor x;    // f32 [k H, k W] or [k H, k W, C]
  Tensor out;  // f32 [H, W] or [H, W, C], written
  int k = 1;   // at least 1
};
void area_mean(Context& ctx, const AreaMean& a);

}  // namespace vsplat
