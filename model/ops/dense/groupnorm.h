// GroupNorm over all rows, as one scale and one shift per channel, which the next reader of the rows applies (see
// RowSource).
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct GroupNormForward {
  Tensor x0;           // [N, C0]
  Tensor x1;           // [N, C1] or none: channels C0 and up; a group may have channels of both
  Tensor gamma, beta;  // [C0 + C1]
  int groups = 1;      // divides C0 + C1
  float eps = 1e-6f;
  Tensor scale, shift;  // [C0 + C1]: GroupNorm(x) = x * scale + shift. With N = 0: gamma / sqrt(eps) and beta
  Tensor mean, rstd;    // [C0 + C1] or none: mean and 1 / sqrt(var + eps) of each channel's group, for the backward
};

void groupnorm_forward(Context& ctx, const GroupNormForward& a);

// Backward of y = SiLU(GroupNorm([x0, x1])), as RowSource composes it.
struct GroupNormBackward {
  Tensor x0, x1;                    // [N, C0], [N, C1] or none: as given to the forward
  Tensor gamma;                     // [C0 + C1]
  Tensor scale, shift, mean, rstd;  // [C0 + C1]: as the forward made them
  int groups = 1;
  Tensor dy;             // [N, C0 + C1]
  Tensor dx0, dx1;       // shaped as x0, x1; dx0 may be dy if there is no x1
  bool add = false;      // dx0 and dx1 are added to, not overwritten
  Tensor dgamma, dbeta;  // [C0 + C1], always added to
};

void groupnorm_backward(Context& ctx, const GroupNormBackward& a);

}  // namespace vsplat
