// GELU (also by tanh), SiLU and ReLU outside of a GEMM: training keeps their inputs, which the GEMM's epilogue would
// not store.
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
  Tensor x;  // the forward's x; for ReLU the forward's out also works, since it is above 0 exactly where x is
  Activation activation = Activation::silu;
  Tensor dy;  // as x
  Tensor dx;  // as x; may be dy; written
};

void activation_backward(Context& ctx, const ActivationBackward& a);

}  // namespace vsplat
