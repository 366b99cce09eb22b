// GroupNorm over all rows, as one scale and one shift per channel for whoever reads the rows next (see RowSource).
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
};

void groupnorm_forward(Context& ctx, const GroupNormForward& a);

}  // namespace vsplat
