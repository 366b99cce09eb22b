// out = act(A B + bias) + residual, in both kernel flavours, where A's rows may be composed on the fly: two sources
// side by side (a concatenation that is never stored), a per-channel affine with SiLU (GroupNorm folded to scale and
// shift), and rows gathered through a map (sparse and strided convolutions as GEMMs).
#pragma once
#include "runtime/context.h"

namespace vsplat {

enum class Activation : int { none = 0, gelu = 1, silu = 2, relu = 3, gelu_tanh = 4 };

// B, repacked once at load in the layout that this context's flavour wants. K x N.
struct PackedMatrix {
  Tensor data;   // cpu: [ceil(N/32), K, 32], zeros beyond N; gpu: [K, N]
  Tensor plain;  // [K, N], only where CLBlast is forced upon the cpu flavour
  long k = 0, n = 0;
};

// From host memory: element (k, n) is at w[k * k_stride + n * n_stride]. A Linear's weight [N,K]: k_stride 1, n_stride
// K.
PackedMatrix pack_matrix(Context& ctx, const float* w, long k, long n, long k_stride, long n_stride,
                         const std::string& what);
// From the device's memory, which may change afterwards (weights in training): element (k, n) is w's element first +
// k * k_stride + n * n_stride. The gradient by a Linear's input, dY W: B is W itself, k_stride K, n_stride 1.
PackedMatrix pack_matrix(Context& ctx, const Tensor& w, long k, long n, long k_stride, long n_stride,
                         const std::string& what, long first = 0);
// Bytes that pack_matrix takes (without PackedMatrix::plain), for planning.
std::size_t packed_bytes(Flavour flavour, long k, long n);

// The side of the gpu flavour's square tiles for an [m, n] output, the work-items of a group, and the defines that
// cl/dense/tile_gpu.clh takes for them: of parameters "tile" and "unroll" (runtime/tuning/tuning.h), and no larger than the device
// takes the kernel in, whose own defines are none.
struct GpuTile {
  long side, group;
  std::string defines;
};
GpuTile gpu_tile(Context& ctx, const KernelId& kernel, const TunedValues& tuned, long m, long n);
// The side of square groups that are no tiles of a product: 16, or 8 where groups of 256 are too large.
long square_side(const Context& ctx);

// Where A's rows come from. Channel c of a row is x0[row, c] for c < C0, else x1[row, c - C0]; then, where there is a
// scale, v = v * scale[c] + shift[c], and SiLU where asked for. Rows that a map calls absent are zero (after all that).
// Leading dimensions of x0 and x1 count as rows: [4, 1025, 768] is 4100 rows.
struct RowSource {
  Tensor x0;            // [rows, C0]
  Tensor x1;            // [rows, C1] or none
  Tensor scale, shift;  // [C0 + C1] or none
  bool silu = false;
  Tensor map;  // i32 [M, T] or none: row m of A is the T gathered rows map[m, t] side by side (K = T (C0 + C1)); < 0 or
               // >= rows is absent
};

// What the cpu flavour's dense kernels are built with on a device (see cl/dense/tile_cpu.clh).
const char* tile_defines(const DeviceInfo& device);
// Where the tile is made of loops (no vectors), llvmpipe would end them all, silently, after 65535 turns of a
// work-item: Error(device) for a sum of more than `terms` that would get there.
void check_tile_terms(const DeviceInfo& device, const char* name, long terms);

struct Gemm {
  RowSource a;
  const PackedMatrix* b = nullptr;
  Tensor bias;  // [N] or none
  Activation activation = Activation::none;
  Tensor residual;  // [M, N] or none; may be `out` itself
  Tensor out;       // [M, N]
  // A part of the rows: rows [row0, row0 + rows) of A (of the map, where there is one), residual and out. rows < 0: all
  // of A's from row0 on.
  long row0 = 0, rows = -1;
  // Where residual and out start, if elsewhere than A (a block of A made in scratch memory). < 0: at row0.
  long out_row0 = -1;
  const char* name = "gemm";  // its row in the profile (packing A: "gemm_pack_a")
  bool exact = false;         // fp32 in mixed precision, too: what results are measured with
};

void gemm(Context& ctx, const Gemm& g);

// out = A^T B, or out + that: a sum over all rows, in which a weight's gradient is made of the layer's input and of
// what comes back (a Linear's [N, K]: A = dY, B = X; its bias: column_sum of dY). Sums of 1024 rows are added up in
// order.
struct TransposedGemm {
  Tensor a;    // f32 [.., M]: leading dimensions count as rows
  Tensor b;    // f32 [.., N], as many rows
  Tensor out;  // f32 [M, N], neither a nor b
  bool add = false;
  const char* name = "gemm_transposed";  // its row in the profile (packing: "gemm_pack_panels", "gemm_pack_plain")
};

void transposed_gemm(Context& ctx, const TransposedGemm& g);

}  // namespace vsplat
