// LayerNorm over the last axis, and adaptive LayerNorm with a shift and a scale for every token.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct LayerNormForward {
  Tensor x;            // [R, C]
  Tensor gamma, beta;  // [C]; both none: ones and zeros
  float eps = 1e-6f;
  Tensor out;  // [R, C]; may be x
};

void layernorm_forward(Context& ctx, const LayerNormForward& a);

// Needs only the forward's inputs and nothing saved: means and deviations are computed again.
struct LayerNormBackward {
  Tensor x;      // [R, C], as in the forward
  Tensor gamma;  // [C]; or none
  float eps = 1e-6f;
  Tensor dy;             // [R, C]: gradient by the forward's out
  Tensor dx;             // [R, C], neither x nor dy; written, or with `add` added to
  Tensor dgamma, dbeta;  // [C], added to; none if there is no gamma
  bool add = false;
};

void layernorm_backward(Context& ctx, const LayerNormBackward& a);

// out = LayerNorm(x) * (1 + scale) + shift, without the first N tokens of every view (class token, registers).
struct ModulateForward {
  Tensor x;            // [V, N + P, C]
  Tensor gamma, beta;  // [C]
  Tensor film;         // [V, P, 2 C]: shift, then scale
  float eps = 1e-6f;
  Tensor out;  // [V, P, C]
};

void modulate_forward(Context& ctx, const ModulateForward& a);

struct ModulateBackward {
  Tensor x;            // [V, N + P, C], as in the forward
  Tensor gamma, beta;  // [C]
  Tensor film;         // [V, P, 2 C]
  float eps = 1e-6f;
  Tensor dy;             // [V, P, C]
  Tensor dx;             // [V, N + P, C], not x; written (0 for tokens left out), or with `add` added to
  Tensor dfilm;          // [V, P, 2 C], not film; written
  Tensor dgamma, dbeta;  // [C], added to
  bool add = false;
};

void modulate_backward(Context& ctx, const ModulateBackward& a);

}  // namespace vsplat
