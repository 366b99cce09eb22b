// Gradients of submanifold convolutions, which are gemm() with pack_submanifold() and a neighbour map.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// Of a loss by the convolution's inputs, weights and biases, of dy, the gradient by its outputs. Summed in a fixed
// order: the same bits each time.
struct SubmanifoldBackward {
  RowSource in;  // as for the forward: x0 [P, C0], x1, scale, shift, silu; the map [P, taps] of sparse_map_forward(),
                 // whose taps are symmetric, or none where taps is 1
  Tensor w;      // [Cout, kx, ky, kz, Cin], as pack_submanifold() took it
  Tensor dy;     // [P, Cout]
  Tensor dx;     // [P, Cin] or none where it is not wanted: by the composed inputs
  bool add_to_dx = false;            // else dx is written
  Tensor dw;                         // [Cout, kx, ky, kz, Cin], added to
  Tensor dbias;                      // [Cout], added to
  const char* name = "submanifold";  // its rows in the profile
};
void submanifold_backward(Context& ctx, const SubmanifoldBackward& a);

}  // namespace vsplat
