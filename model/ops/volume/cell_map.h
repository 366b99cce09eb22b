// The neighbourhood of points in the cells of a sparse grid, for submanifold convolutions as GEMMs. Such a convolution
// does not provide for several points in one cell: the one with the highest index represents it. (For cells of a dense
// grid with one voxel each see sparse_map.h.)
#pragma once
#include "model/ops/volume/space_curve.h"

namespace vsplat {

struct CellMapForward {
  GridCells cells;  // cells of P points
  Tensor codes;     // u64 [P]: places along Morton's curve, ascending
  Tensor points;    // u32 [P]: the point at each place; points at equal places ascend
  // Whether every point has all 27 taps; otherwise points that do not represent their cell have only the first 13 and
  // their own, as in the published library.
  bool all = false;
  Tensor standing;  // i32 [P], written: the point that represents the cell of each
  Tensor map;       // i32 [P,27], written: x slowest, -1 if there is none; a point's own tap is itself
};
void cell_map_forward(Context& ctx, const CellMapForward& a);

// For the convolution's derivative by its inputs.
struct CellMapBackward {
  GridCells cells;
  Tensor codes, points;
  bool all = false;
  Tensor standing;  // as the forward wrote it
  Tensor map;       // i32 [P,27], written: rows of cell_sums()' [2 P, C]
};
void cell_map_backward(Context& ctx, const CellMapBackward& a);

// x [P,C] -> [2 P, C]: x, then for each point that represents a cell the sum of the rows of the points in it, and zeros
// for the others.
Tensor cell_sums(Context& ctx, const Tensor& x, const Tensor& standing);

}  // namespace vsplat
