// A step of Muon on the device: the optimiser of weights that are matrices (Jordan et al. 2024,
// https://kellerjordan.github.io/posts/muon). Nothing here waits for the device, and every run gives the same bits.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Replaces the moving average of the gradient, with Nesterov's look-ahead, by a matrix with the same singular vectors
// whose singular values are all near 1 (0.7 to 1.2): five Newton-Schulz iterations with the published coefficients. A
// scale of 0.2 sqrt(the larger of rows and columns) makes the step as large as AdamW's (Liu et al. 2025), so that
// learning rate and weight decay mean the same as there.
struct MuonStep {
  Tensor param, grad, m;  // f32 of one shape [rows, ..]; all but the first dimension count as columns; m starts as
                          // zeros
  Tensor clip;            // [2], GradientClip's out; none: the gradient is used unchanged
  double lr = 4e-4, momentum = 0.95, weight_decay = 0.05;
};

void muon_step(Context& ctx, const MuonStep& a);

}  // namespace vsplat
