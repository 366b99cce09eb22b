// A step of Muon on the device: the optimiser of weights that are matrices (Jordan et al. 2024,
// https://kellerjordan.github.io/posts/muon). Nothing here waits for the device, and every run gives the same bits.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// The moving average of the gradient, looked ahead as Nesterov does, is replaced by a matrix with the same singular
// vectors whose singular values are all near 1 (0.7 to 1.2): five steps of Newton and Schulz's iteration with the
// published coefficients. Scaled by 0.2 sqrt(the larger of rows and columns) it is as large as AdamW's steps are (Liu
// et al. 2025), so that learning rate and weight decay mean what they mean there.
struct MuonStep {
  Tensor param, grad, m;  // f32 of one shape [rows, ..], of which all but the first dimension count as columns; m
                          // starts as zeros
  Tensor clip;            // [2], GradientClip's out; none: the gradient as it is
  double lr = 4e-4, momentum = 0.95, weight_decay = 0.05;
};

void muon_step(Context& ctx, const MuonStep& a);

}  // namespace vsplat
