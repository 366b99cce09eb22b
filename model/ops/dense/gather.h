// Rows by index.
#pragma once
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

struct GatherForward {
  Tensor x;      // [N, C]
  Tensor index;  // i32 [P], each in 0..N shared - 1
  Tensor out;    // [P, W]; columns column .. column + C - 1 are written
  long column = 0;
  long shared = 1;  // how many indices mean one row: index / shared is the row (primitives of a voxel)
  long row0 = -1;   // from 0 on: out has any number of rows, and those from row0 to row0 + P - 1 are written
};
void gather_forward(Context& ctx, const GatherForward& a);

struct GatherBackward {
  Tensor dout;   // [P, W]
  Tensor index;  // i32 [P], each in 0..N shared - 1 and no two equal; negative ones are passed over
  Tensor dx;  // [N, C], added to: to row index[p] / shared dout's row p, columns column .. column + C - 1; others stay
  long column = 0;
  long shared = 1;  // above 1 the indices ascend, and none is negative
  long row0 = -1;   // from 0 on: as forward had it, of dout's rows
};
void gather_backward(Context& ctx, const GatherBackward& a);

// x i32 [N], index i32 [P], each in 0..N - 1 -> i32 [P]
Tensor gather_integers(Context& ctx, const Tensor& x, const Tensor& index);

// The Gaussians of the given indices.
DeviceGaussians gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index);
// The same into the Gaussians row0 .. row0 + P - 1 of `out`.
void gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index, const DeviceGaussians& out, long row0);
// Adds those tensors of `dout` [P, ..] that are not none to the rows of `dx` [N, ..] that `index` names, no two of
// which are equal. `row0`: as GatherBackward has it.
void gather_backward(Context& ctx, const GaussianGradients& dout, const Tensor& index, const GaussianGradients& dx,
                     long row0 = -1);

}  // namespace vsplat
