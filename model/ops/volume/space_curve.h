// Points in the order of curves that fill space.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct GridCells {
  Tensor cells;   // i32 [P,3]: from the smallest coordinate of each axis on
  int depth = 1;  // bits of the largest cell, at least 1
};

// points f32 [P,3], P at least 1; `cell` is a cell's edge. Waits for the queue: the depth is read back. Error(input)
// where it would be more than 16; a plan takes it for that.
GridCells grid_cells(Context& ctx, const Tensor& points, double cell);

enum class Curve { morton, hilbert };
// u64 [P]: each cell's place along the curve, of 3 depth bits. Morton's has x in the highest bit of each triple.
// `exchanged`: x and y change places first.
Tensor curve_codes(Context& ctx, const GridCells& cells, Curve curve, bool exchanged);

// The points along a curve in runs of `size`. Fewer points than that are one run. Otherwise the last run, where it is
// not full, ends with the same columns of the run before it.
struct CurveRuns {
  long runs = 0, size = 0;
  Tensor slots;   // i32 [runs size]: which point is in each slot; the first P of them name each point once
  Tensor places;  // i32 [P]: which of the first P slots is a point's own
  Tensor filled;  // i32 [runs size - P]: the points in the slots behind the first P
};
// order u32 [P]: the points along the curve.
CurveRuns curve_runs(Context& ctx, const Tensor& order, long size);

}  // namespace vsplat
