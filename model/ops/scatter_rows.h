// The transposed of sampling: weighted rows are added to the rows that they were sampled from, always in one order.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// E entries in the order of the rows that they go to, for as many scatterings as share them.
struct ScatterPlan {
  long rows = 0;  // that are scattered to
  Tensor from;    // u32 [E]: which entry; by row, those of a row in their own order, those passed over at the end
  Tensor keys;    // u32 [E]: the row it goes to, `rows` where it is passed over; in the order of `from`, as are
  Tensor weight;  // [E]
  Tensor starts;  // u32 [rows + 1]: where each row's run begins
};

// index: i32, E of them in any shape, each below `rows`; negative ones are passed over, and so is whatever has weight
// 0. weight: shaped as index. E and rows are below 2^31.
ScatterPlan make_scatter_plan(Context& ctx, const Tensor& index, const Tensor& weight, long rows);

// out[index[e]] += scale * weight[e] * d[first + e / per_row] for each entry e, those of a row in their order.
struct ScatterRows {
  const ScatterPlan* plan = nullptr;
  Tensor d;          // [D, C]
  long first = 0;    // row of d that the first entries take
  long per_row = 1;  // entries that take the same row of d: 4 where it has a row per sample, 4 V where V are averaged
  float scale = 1;
  Tensor out;  // [rows, C]
};
void scatter_rows(Context& ctx, const ScatterRows& a);

}  // namespace vsplat
