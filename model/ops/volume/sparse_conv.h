// Submanifold convolutions: only over active voxels, whose rows are found through a neighbour map (sparse_map.h).
#pragma once
#include "model/ops/dense/conv3d.h"

namespace vsplat {

// w [Cout][kx][ky][kz][Cin] with `taps` = kx ky kz; bias [Cout] or null.
ConvWeights pack_submanifold(Context& ctx, const float* w, const float* bias, long cout, long taps, long cin,
                             const std::string& what);

// The same from device memory, for weights that training changes. w [Cout, kx, ky, kz, Cin]; bias [Cout] or none.
ConvWeights pack_submanifold(Context& ctx, const Tensor& w, const Tensor& bias, const std::string& what);

struct SubmanifoldForward {
  RowSource in;  // x0 [P, C0], x1, scale, shift, silu; the map [P, taps] of sparse_map_forward(), none if taps is 1
  const ConvWeights* weights = nullptr;
  Tensor residual;                   // [P, Cout] or none; may be `out`
  Tensor out;                        // [P, Cout]
  const char* name = "submanifold";  // its row in the profile
};
void submanifold_forward(Context& ctx, const SubmanifoldForward& a);

// Gradients by the convolution's inputs, weights and biases, from dy, the gradient by its outputs. Summed in a fixed
// order: the same bits each time.
struct SubmanifoldBackward {
  RowSource in;                      // as for the forward; the map's taps are symmetric, otherwise see `back`
  Tensor w;                          // [Cout, kx, ky, kz, Cin], as pack_submanifold() took it
  Tensor dy;                         // [P, Cout]
  Tensor dx;                         // [P, Cin]: gradient by the composed inputs; none: not computed
  bool add = false;                  // dx is added to, not overwritten
  Tensor dw;                         // [Cout, kx, ky, kz, Cin], added to
  Tensor dbias;                      // [Cout], added to
  const char* name = "submanifold";  // its rows in the profile
  // If points share cells (cell_map.h), so that the map's taps are not symmetric: cell_map_backward()'s map [P, taps],
  // and cell_sums() of dy [2 P, Cout].
  Tensor back, back_dy;
};
void submanifold_backward(Context& ctx, const SubmanifoldBackward& a);

}  // namespace vsplat
