// Sums over rows in a fixed order: gradients of biases, and the end of any sum that was made in parts.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// out = sum over rows of x, or out + that. A sum of R terms is made of sums of 64 at most, so that rounding grows with
// log R. The same bits each time.
struct ColumnSum {
  Tensor x;    // f32 [.., C]: leading dimensions count as rows
  Tensor out;  // f32, C in all
  bool add = false;
};

void column_sum(Context& ctx, const ColumnSum& a);

}  // namespace vsplat
