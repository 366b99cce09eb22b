// out = act(A B + bias) + residual, in both kernel flavours. The rows of A may be composed on the fly: two sources side
// by side (a concatenation that is never stored), a per-channel affine with SiLU (GroupNorm folded to scale and shift),
// and rows gathered through a map (sparse and strided convolutions as GEMMs).
#pragma once
#include "runtime/context.h"

namespace vsplat {

enum class Activation : int { none = 0, gelu = 1, silu = 2, relu = 3, gelu_tanh = 4 };

// Matrix B, K x N, repacked once at load into the layout of this context's flavour.
struct PackedMatrix {
  Tensor data;   // cpu: [ceil(N/32), K, 32], zeros beyond N; gpu: [K, N]
  Tensor plain;  // [K, N], only if CLBlast is forced on the cpu flavour
  long k = 0, n = 0;
  bool pairs = false;  // mixed precision of the cpu flavour: u32 [ceil(N/32), ceil(K/2), 32], see gemm_pairs.h
};

// Packs from host memory: element (k, n) is w[k * k_stride + n * n_stride]. For a Linear's weight [N,K]: k_stride 1,
// n_stride K.
// `exact`: for products with Gemm::exact, and for kernels other than gemm()'s.
PackedMatrix pack_matrix(Context& ctx, const float* w, long k, long n, long k_stride, long n_stride,
                         const std::string& what, bool exact = false);
// Packs from device memory, which may change afterwards (weights in training): element (k, n) is w's element first + k
// * k_stride + n * n_stride. For the gradient by a Linear's input, dY W, B is W itself: k_stride K, n_stride 1.
PackedMatrix pack_matrix(Context& ctx, const Tensor& w, long k, long n, long k_stride, long n_stride,
                         const std::string& what, long first = 0);
// Bytes that pack_matrix allocates (without PackedMatrix::plain), for planning.
std::size_t packed_bytes(Flavour flavour, long k, long n);

// Tile of the gpu flavour for an [m, n] output: the side of the square tile, the work-items of a group, and the defines
// for cl/dense/tile_gpu.clh. It follows the parameters "tile" and "unroll" (runtime/tuning/tuning.h), and is no larger
// than the device can run. `kernel` names the kernel, without defines of its own.
struct GpuTile {
  long side, group;
  std::string defines;
};
GpuTile gpu_tile(Context& ctx, const KernelId& kernel, const TunedValues& tuned, long m, long n);
// The side of square work-groups that compute no tile of a product: 16, or 8 if the device cannot run groups of 256.
long square_side(const Context& ctx);

// The source of A's rows. Channel c of a row is x0[row, c] for c < C0, else x1[row, c - C0]. With a scale, v becomes v
// * scale[c] + shift[c]; with `silu`, SiLU follows. Rows that a map marks as absent are zero (after all of that).
// Leading dimensions of x0 and x1 count as rows: [4, 1025, 768] has 4100 rows.
struct RowSource {
  Tensor x0;            // [rows, C0]
  Tensor x1;            // [rows, C1] or none
  Tensor scale, shift;  // [C0 + C1] or none
  bool silu = false;
  Tensor map;  // i32 [M, T] or none: row m of A is the T gathered rows map[m, t] side by side (K = T (C0 + C1)); < 0 or
               // >= rows is absent
};

// Defines that the cpu flavour's dense kernels are built with on a device (see cl/dense/tile_cpu.clh).
const char* tile_defines(const DeviceInfo& device);
// Error(device) for sums of more than `terms` terms on llvmpipe: if the tile is computed in loops (without vectors),
// llvmpipe silently ends all loops of a work-item after 65535 iterations.
void check_tile_terms(const DeviceInfo& device, const char* name, long terms);

struct Gemm {
  RowSource a;
  const PackedMatrix* b = nullptr;
  Tensor bias;  // [N] or none
  Activation activation = Activation::none;
  Tensor residual;  // [M, N] or none; may be `out` itself
  Tensor out;       // [M, N]
  // Limits the product to rows [row0, row0 + rows) of A (of the map, if there is one), residual and out. rows < 0: all
  // rows of A from row0 on.
  long row0 = 0, rows = -1;
  // First row of residual and out, if it differs from A's (a block of A in scratch memory). < 0: row0.
  long out_row0 = -1;
  const char* name = "gemm";  // its row in the profile (packing A: "gemm_pack_a", "gemm_pack_a_pairs")
  bool exact = false;         // fp32 even in mixed precision: for measuring results; B is packed so
};

void gemm(Context& ctx, const Gemm& g);

// out = A^T B, or out plus that: a sum over all rows. It computes a weight's gradient from the layer's input and the
// gradient of its output (a Linear's [N, K]: A = dY, B = X; its bias: column_sum of dY). Sums of 1024 rows are added up
// in order.
struct TransposedGemm {
  Tensor a;    // f32 [.., M]: leading dimensions count as rows
  Tensor b;    // f32 [.., N], as many rows
  Tensor out;  // f32 [M, N], neither a nor b
  bool add = false;
  const char* name = "gemm_transposed";  // its row in the profile (packing: "gemm_pack_panels", "gemm_pack_plain")
};

void transposed_gemm(Context& ctx, const TransposedGemm& g);

}  // namespace vsplat
