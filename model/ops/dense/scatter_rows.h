// The reverse of sampling: weighted rows are added to the rows that they were sampled from, always in one order.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// E entries sorted by the rows that they go to. A plan serves any number of scatterings.
struct ScatterPlan {
  long rows = 0;  // rows of what is scattered to
  Tensor from;    // u32 [E]: which entry each sorted one is; those of a row in their own order, those passed over last
  Tensor keys;    // u32 [E]: the row that each sorted entry goes to; `rows` where it is passed over
  Tensor weight;  // [E]: the sorted entries' weights
  Tensor starts;  // u32 [rows + 1]: where each row's run of sorted entries begins
};

// index: i32, E numbers in any shape, each below `rows`; entries with a negative one are passed over, and so are those
// with weight 0. weight: shaped as index. E and rows are below 2^31.
ScatterPlan make_scatter_plan(Context& ctx, const Tensor& index, const Tensor& weight, long rows);

// out[index[e]] += scale * weight[e] * d[first + e / per_row] for each entry e, those of a row in their order.
struct ScatterRows {
  const ScatterPlan* plan = nullptr;
  Tensor d;          // [D, C]
  long first = 0;    // row of d that the first entries take
  long per_row = 1;  // entries that share a row of d: 4 where d has a row per sample, 4 V where V samples are averaged
  float scale = 1;
  Tensor out;  // [rows, C]
};
void scatter_rows(Context& ctx, const ScatterRows& a);

}  // namespace vsplat
