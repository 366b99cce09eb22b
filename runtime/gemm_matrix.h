// Matrix products of rounded operands, on fragments (cl/dense/matrix.clh): gemm() and Winograd convolutions use them in
// a context of mixed precision when they pay off.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// The type that operands are rounded to: 8 bits of significand (bf16) or 11 (tf32).
enum class Operands : int { bf16 = 0, tf32 = 1 };

// Several products of one shape, side by side: out = act(A B + bias) + residual.
struct MatrixProducts {
  RowSource a;    // x0 [products][src_rows, C0]; all products share x1, scale, shift and map
  long line = 0;  // > 0, only without a map: A's rows come in lines of so many rows; a source line has two rows more,
                  // and each row of A is three neighbouring source rows side by side (cl/dense/gemm_matrix.clh)
  long src_rows = 0, row0 = 0;
  Tensor b;  // [products][K, N], as PackedMatrix::data of the gpu flavour
  long products = 1, m = 0, n = 0;
  Tensor bias;  // [N] or none
  Activation activation = Activation::none;
  Tensor residual;  // [.., N] or none; only with one product
  Tensor out;       // [products][M, N], from row out_row0 on
  long out_row0 = 0;
  const char* name = "gemm";
  Cost cost;
  Operands operands = Operands::bf16;
};

// Uses the context's matrix units, in any precision.
void gemm_matrix(Context& ctx, const MatrixProducts& p);

// Whether a product of that shape goes to gemm_matrix(): in mixed precision, unless a fragment would be mostly padding.
bool wants_matrix(const Context& ctx, long m, long n, long k);

}  // namespace vsplat
