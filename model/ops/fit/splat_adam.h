// Adam on the parameters of Gaussians, one kind at a time.
#pragma once
#include <limits>

#include "runtime/context.h"

namespace vsplat {

// Bias-corrected, without decay. Moments start as zeros. Clears the gradient. Never waits for the device; every run
// gives the same bits.
struct SplatAdam {
  Tensor param, grad, m, v;  // f32 [K, ...], of one shape
  long step = 1;             // from 1
  double rate = 1e-3;
  // The parameters of each Gaussian from `head` on have the learning rate `rate_rest`; 0: none.
  long head = 0;
  double rate_rest = 0;
  double beta1 = 0.9, beta2 = 0.999, eps = 1e-15;
  float low = -std::numeric_limits<float>::infinity(),
        high = std::numeric_limits<float>::infinity();  // clamped
  // Leaves parameters with a gradient of exactly 0 unchanged, with their moments.
  bool sparse = false;
};

void splat_adam(Context& ctx, const SplatAdam& a);

}  // namespace vsplat
