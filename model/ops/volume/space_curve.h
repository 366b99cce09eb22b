// Orders points along space-filling curves.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct GridCells {
  Tensor cells;   // i32 [P,3]: relative to the smallest coordinate of each axis
  int depth = 1;  // bits of the largest cell, at least 1
};

// points f32 [P,3], P at least 1; `cell` is a cell's edge. Waits for the queue: the depth is read back. Error(input) if
// it exceeds 16; a planner assumes 16.
GridCells grid_cells(Context& ctx, const Tensor& points, double cell);

enum class Curve { morton, hilbert };
// u64 [P]: each cell's place along the curve, of 3 depth bits. Morton order has x in the highest bit of each triple.
// `exchanged`: x and y are exchanged first.
Tensor curve_codes(Context& ctx, const GridCells& cells, Curve curve, bool exchanged);

// The points along a curve in runs of `size`. Fewer points form one run. Otherwise a last run that is not full is
// filled with the same columns of the run before it.
struct CurveRuns {
  long runs = 0, size = 0;
  Tensor slots;   // i32 [runs size]: the point in each slot; the first P slots have each point once
  Tensor places;  // i32 [P]: the slot of each point, among the first P
  Tensor filled;  // i32 [runs size - P]: the points in the slots after the first P
};
// order u32 [P]: the points along the curve.
CurveRuns curve_runs(Context& ctx, const Tensor& order, long size);

}  // namespace vsplat
