// The neighbourhood of points in the cells of a sparse grid, for submanifold convolutions as GEMMs. Several points may
// lie in one cell, which such a convolution does not provide for: the one of the highest index stands for it. (For
// cells of a dense grid with one voxel each see sparse_map.h.)
#pragma once
#include "model/ops/volume/space_curve.h"

namespace vsplat {

struct CellMapForward {
  GridCells cells;  // of P points
  Tensor codes;     // u64 [P]: places along Morton's curve, ascending
  Tensor points;    // u32 [P]: which point each of them is, of equal places in ascending order
  // Whether every point has all 27 taps; else points that do not stand for their cell have the first 13 and their own
  // alone, as the published library leaves them.
  bool all = false;
  Tensor standing;  // i32 [P], written: which point stands for the cell of each
  Tensor map;       // i32 [P,27], written: x slowest, -1 where there is none; a point's own is itself
};
void cell_map_forward(Context& ctx, const CellMapForward& a);

// For the convolution's derivative by its inputs.
struct CellMapBackward {
  GridCells cells;
  Tensor codes, points;
  bool all = false;
  Tensor standing;  // as forward left it
  Tensor map;       // i32 [P,27], written: rows of cell_sums()' [2 P, C]
};
void cell_map_backward(Context& ctx, const CellMapBackward& a);

// x [P,C] -> [2 P, C]: x, then for each point that stands for a cell the sum of the rows of the points in it, and zeros
// for the others.
Tensor cell_sums(Context& ctx, const Tensor& x, const Tensor& standing);

}  // namespace vsplat
