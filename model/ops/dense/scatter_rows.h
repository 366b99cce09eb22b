// The reverse of sampling: adds weighted rows to the rows that they were sampled from, always in one order.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// E entries sorted by their target rows. A plan can be used for any number of scatterings.
struct ScatterPlan {
  long rows = 0;  // rows of the target
  Tensor from;    // u32 [E]: the index of each sorted entry; entries of a row keep their order, skipped ones come last
  Tensor keys;    // u32 [E]: the target row of each sorted entry; `rows` if it is skipped
  Tensor weight;  // [E]: the sorted entries' weights
  Tensor starts;  // u32 [rows + 1]: where each row's run of sorted entries begins
};

// index: i32, E numbers in any shape, each below `rows`; entries with a negative index or with weight 0 are skipped.
// weight: shaped as index. E and rows are below 2^31.
ScatterPlan make_scatter_plan(Context& ctx, const Tensor& index, const Tensor& weight, long rows);

// out[index[e]] += scale * weight[e] * d[first + e / per_row] for each entry e, those of a row in their order.
struct ScatterRows {
  const ScatterPlan* plan = nullptr;
  Tensor d;          // [D, C]
  long first = 0;    // row of d for the first entries
  long per_row = 1;  // entries that share a row of d: 4 if d has a row per sample, 4 V if V samples are averaged
  float scale = 1;
  Tensor out;  // [rows, C]
};
void scatter_rows(Context& ctx, const ScatterRows& a);

}  // namespace vsplat
