// Writes to memory the rows that a GEMM composes on the fly: for sums over rows (transposed_gemm), or for rows that are
// read many times.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// Composes rows [row0, row0 + out's rows) of `in` (of its map, if it has one) into out [rows, T (C0 + C1)].
void compose_rows(Context& ctx, const RowSource& in, const Tensor& out, long row0 = 0);

}  // namespace vsplat
