// out = act(A B + bias) + residual, in both kernel flavours, where A's rows may be composed on the fly:
// two sources side by side (a concatenation that is never stored), a per-channel affine with SiLU (GroupNorm
// folded to scale and shift), and rows gathered through a map (sparse and strided convolutions as GEMMs).
#pragma once
#include "runtime/context.h"

namespace vsplat {

enum class Activation : int { none = 0, gelu = 1, silu = 2 };

// B, repacked once at load in the layout that this context's flavour wants. K x N.
struct PackedMatrix {
  Tensor data;
  long k = 0, n = 0;
};

// From host memory: element (k, n) is at w[k * k_stride + n * n_stride]. A Linear's weight [N,K]: k_stride 1, n_stride
// K.
PackedMatrix pack_matrix(Context& ctx, const float* w, long k, long n, long k_stride, long n_stride,
                         const std::string& what);
// Bytes that pack_matrix will take, for planning.
std::size_t packed_bytes(Flavour flavour, long k, long n);

// Where A's rows come from. Channel c of a row is x0[row, c] for c < C0, else x1[row, c - C0]; then, where there is a
// scale, v = v * scale[c] + shift[c], and SiLU where asked for. Rows that a map calls absent are zero (after all that).
struct RowSource {
  Tensor x0;            // [rows, C0]
  Tensor x1;            // [rows, C1] or none
  Tensor scale, shift;  // [C0 + C1] or none
  bool silu = false;
  Tensor map;  // i32 [M, T] or none: row m of A is the T gathered rows map[m, t] side by side (K = T (C0 + C1)); < 0 or
               // >= rows is absent
};

struct Gemm {
  RowSource a;
  const PackedMatrix* b = nullptr;
  Tensor bias;  // [N] or none
  Activation activation = Activation::none;
  Tensor residual;  // [M, N] or none; may be `out` itself
  Tensor out;       // [M, N]
  // A part of the rows: rows [row0, row0 + rows) of A (of the map, where there is one), residual and out. rows < 0:
  // all.
  long row0 = 0, rows = -1;
  const char* name = "gemm";  // the row it gets in the profile is "<name>"
};

void gemm(Context& ctx, const Gemm& g);

}  // namespace vsplat
