// Copies rows by index.
#pragma once
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

struct GatherForward {
  Tensor x;      // [N, C]
  Tensor index;  // i32 [P], each in 0..N shared - 1
  Tensor out;    // [P, W]; columns column .. column + C - 1 are written
  long column = 0;
  long shared = 1;  // number of indices for one row: index / shared is the row (primitives of a voxel)
  long row0 = -1;   // >= 0: out has any number of rows, and row0 .. row0 + P - 1 are written
};
void gather_forward(Context& ctx, const GatherForward& a);

struct GatherBackward {
  Tensor dout;   // [P, W]
  Tensor index;  // i32 [P], each in 0..N shared - 1 and no two equal; negative ones are skipped
  Tensor dx;     // [N, C], added to: row index[p] / shared gets dout's row p, columns column .. column + C - 1; others
                 // stay
  long column = 0;
  long shared = 1;  // above 1 the indices ascend, and none is negative
  long row0 = -1;   // >= 0: the forward's row0, an index into dout's rows
};
void gather_backward(Context& ctx, const GatherBackward& a);

// x i32 [N], index i32 [P], each in 0..N - 1 -> i32 [P]
Tensor gather_integers(Context& ctx, const Tensor& x, const Tensor& index);

// Copies the Gaussians with the given indices.
DeviceGaussians gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index);
// Copies them to the Gaussians row0 .. row0 + P - 1 of `out`.
void gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index, const DeviceGaussians& out, long row0);
// Adds the tensors of `dout` [P, ..] that are not none to the rows of `dx` [N, ..] that `index` names; no two indices
// are equal. `row0`: see GatherBackward.
void gather_backward(Context& ctx, const GaussianGradients& dout, const Tensor& index, const GaussianGradients& dx,
                     long row0 = -1);

}  // namespace vsplat
