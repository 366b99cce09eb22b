// The gradient of what many faint Gaussians cost: weight times the mean of ln(1 + opacity / SOFT). It pulls at a faint
// Gaussian up to 20 times as hard as at an opaque one.
// ```
// argument    type  shape  what
// opacities   f32   [K]    0 to 1
// dopacities  f32   [K]    added to
// weight      float        of the mean, divided by K
// work-items  one per Gaussian
// ```
#include "common.clh"

#define SOFT 0.05f

kernel void sparsity_loss(global const float* opacities, global float* dopacities, int K, float weight) {
  const int k = get_global_id(0);
  if (k < K) dopacities[k] += weight / (SOFT + opacities[k]);
}
