// GELU (also by tanh), SiLU and ReLU outside of a GEMM: in training their inputs are kept, which the GEMM's
// epilogue would not do.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

struct ActivationForward {
  Tensor x;  // f32, any shape
  Activation activation = Activation::silu;
  Tensor out;  // as x; may be x
};

void activation_forward(Context& ctx, const ActivationForward& a);

struct ActivationBackward {
  Tensor x;  // as forward had it; of ReLU forward's out does as well, which is above 0 where x is
  Activation activation = Activation::silu;
  Tensor dy;  // as x
  Tensor dx;  // as x; may be dy; written
};

void activation_backward(Context& ctx, const ActivationBackward& a);

}  // namespace vsplat
