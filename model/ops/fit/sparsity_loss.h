// A loss that makes a few opaque Gaussians of many faint ones: the mean of ln(1 + opacity / 0.05).
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct SparsityLoss {
  Tensor opacities;   // f32 [K]
  Tensor dopacities;  // f32 [K]: weight times the loss's gradient is added
  float weight = 0;
};
void sparsity_loss(Context& ctx, const SparsityLoss& a);

}  // namespace vsplat
