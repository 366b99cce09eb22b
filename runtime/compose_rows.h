// What a GEMM composes on the fly, in memory: rows for sums over rows (transposed_gemm), or to be read many times.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// Rows [row0, row0 + out's rows) of `in` (of its map, where there is one) into out [rows, T (C0 + C1)].
void compose_rows(Context& ctx, const RowSource& in, const Tensor& out, long row0 = 0);

}  // namespace vsplat
