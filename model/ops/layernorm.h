// LayerNorm over the last axis, and the same with a shift and a scale of its own for every token (adaptive layer norm).
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct LayerNormForward {
  Tensor x;            // [R, C]
  Tensor gamma, beta;  // [C]
  float eps = 1e-6f;
  Tensor out;  // [R, C]; may be x
};

void layernorm_forward(Context& ctx, const LayerNormForward& a);

// out = LayerNorm(x) * (1 + scale) + shift, the first (class) token of every view left out.
struct ModulateForward {
  Tensor x;            // [V, 1 + P, C]
  Tensor gamma, beta;  // [C]
  Tensor film;         // [V, P, 2 C]: shift, then scale
  float eps = 1e-6f;
  Tensor out;  // [V, P, C]
};

void modulate_forward(Context& ctx, const ModulateForward& a);

}  // namespace vsplat
