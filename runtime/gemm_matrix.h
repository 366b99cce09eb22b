// Matrix products of rounded operands, on fragments (cl/dense/matrix.clh): what gemm() and convolutions by Winograd's method
// multiply with in a context of mixed precision, where it pays.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// What operands are rounded to: 8 bits of significand, or 11.
enum class Operands : int { bf16 = 0, tf32 = 1 };

// Several products of one shape, side by side: out = act(A B + bias) + residual.
struct MatrixProducts {
  RowSource a;    // x0 [products][src_rows, C0]; x1, scale, shift and map are the same of each
  long line = 0;  // > 0, without a map: A's rows are of lines of so many source rows and two more, and have three
                  // neighbours each, side by side (cl/dense/gemm_matrix.clh)
  long src_rows = 0, row0 = 0;
  Tensor b;  // [products][K, N], as PackedMatrix::data of the gpu flavour
  long products = 1, m = 0, n = 0;
  Tensor bias;  // [N] or none
  Activation activation = Activation::none;
  Tensor residual;  // [.., N] or none, and with one product alone
  Tensor out;       // [products][M, N], from row out_row0 on
  long out_row0 = 0;
  const char* name = "gemm";
  Cost cost;
  Operands operands = Operands::bf16;
};

// By the context's matrix units, whatever its precision.
void gemm_matrix(Context& ctx, const MatrixProducts& p);

// Whether products of that shape are made so: in mixed precision, where no fragment is mostly padding.
bool wants_matrix(const Context& ctx, long m, long n, long k);

}  // namespace vsplat
