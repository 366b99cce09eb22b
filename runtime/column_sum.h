// Sums over rows in a fixed order: gradients of biases, and the last step of any sum that was computed in parts.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// out = sum over rows of x, or out plus that sum. R terms are added through partial sums of at most 64 terms, so that
// rounding errors grow with log R. The result has the same bits each time.
struct ColumnSum {
  Tensor x;    // f32 [.., C]: leading dimensions count as rows
  Tensor out;  // f32, C in all
  bool add = false;
};

void column_sum(Context& ctx, const ColumnSum& a);

}  // namespace vsplat
