// The neighbourhood of active voxels, for submanifold convolutions as GEMMs.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct SparseMapForward {
  Tensor index;     // i32 [P]: active voxels of the R^3 grid, x slowest, no two equal
  long volume = 0;  // R
  Tensor map;       // i32 [P, 27]: row of each voxel of the 3x3x3 neighbourhood (x slowest), -1 if it is not active
};
void sparse_map_forward(Context& ctx, const SparseMapForward& a);

}  // namespace vsplat
