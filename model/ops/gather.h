// Rows by index.
#pragma once
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

struct GatherForward {
  Tensor x;      // [N, C]
  Tensor index;  // i32 [P], each in 0..N-1
  Tensor out;    // [P, W]; columns column .. column + C - 1 are written
  long column = 0;
};
void gather_forward(Context& ctx, const GatherForward& a);

struct GatherBackward {
  Tensor dout;   // [P, W]
  Tensor index;  // i32 [P], each in 0..N-1 and no two equal; negative ones are passed over
  Tensor dx;     // [N, C], added to: to row index[p] dout's row p, columns column .. column + C - 1; other rows stay
  long column = 0;
};
void gather_backward(Context& ctx, const GatherBackward& a);

// The Gaussians of the given indices.
DeviceGaussians gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index);
// Adds those tensors of `dout` [P, ..] that are not none to the rows of `dx` [N, ..] that `index` names, no two of
// which are equal.
void gather_backward(Context& ctx, const GaussianGradients& dout, const Tensor& index, const GaussianGradients& dx);

}  // namespace vsplat
