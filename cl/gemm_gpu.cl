// out = act(A B + bias) + residual, gpu flavour: tiles through local memory, A composed while it is loaded.
//   Row m in [0, M) of A is, for each of T taps, the source row map[row0 + m, t] (row0 + m where map is null): x0's c0 channels, then x1's
//   c1; with scale v * scale[c] + shift[c]; with silu v / (1 + exp(-v)). A source row outside [0, src_rows) is zero after all that.
//   x0 [src_rows, c0]; x1 [src_rows, c1] or null; scale, shift [c0 + c1] or null; map [.., T] or null; b [T (c0 + c1), N]
//   bias [N] or null; residual, out [.., N] from row out_row0 on; residual may be null or out itself. act: 0 none, 1 GELU, 2 SiLU.
struct Rows {
  global const int* map;
  int row0, T;
};
static inline int source_row(const struct Rows* r, int m, int t) {
  return r->map ? r->map[(size_t)(r->row0 + m) * r->T + t] : r->row0 + m;
}
#include "tile_gpu.clh"

kernel __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void gemm_tile_gpu(
    global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
    global const float* shift, int silu_a, global const int* map, int T, int src_rows, int row0, global const float* b,
    int M, int N, global const float* bias, int act, global const float* residual, global float* out, int out_row0) {
  local float as[BK * AS], bs[BK * BN];
  const struct Rows rows = {map, row0, T};
  tile_gpu(as, bs, x0, c0, x1, c1, scale, shift, silu_a, &rows, T, src_rows, b, M, N, bias, act, residual, out,
           out_row0);
}

// parts[s] = the sum over rows [s chunk, (s + 1) chunk) of A^T B, + residual. Of B [.., N] the rows from `first` on are meant, `rows` in all.
//   at: for every s in turn A's rows as columns, [M, min(chunk, rows - s chunk)]; parts [.., M, N]; residual: null, or parts with one s.
// Work-groups: (column of tiles, row of tiles, s).
kernel __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void gemm_transposed_gpu(
    global const float* at, global const float* b, int first, int rows, int chunk, int M, int N,
    global const float* residual, global float* parts) {
  local float as[BK * AS], bs[BK * BN];
  const int s = get_group_id(2);
  const struct Rows plain = {0, 0, 1};
  tile_gpu(as, bs, at + (size_t)s * chunk * M, min(chunk, rows - s * chunk), 0, 0, 0, 0, 0, &plain, 1, M,
           b + ((size_t)first + (size_t)s * chunk) * N, M, N, 0, 0, residual, parts, s * M);
}

#define PACK_SIDE 16

// Any matrix [K, N] on the device as matrices of `piece` columns each, one after the other (the last may be narrower). Element (k, n) is
// w[offset + k * k_stride + (first + n) * n_stride]. Through local memory, so that neighbours read and write neighbours where a stride is 1.
// Work-groups of PACK_SIDE x PACK_SIDE: (columns, rows, piece).
kernel __attribute__((reqd_work_group_size(PACK_SIDE * PACK_SIDE, 1, 1))) void gemm_pack_plain(
    global const float* w, int offset, int first, int K, int N, int k_stride, int n_stride, int piece,
    global float* out) {
  local float tile[PACK_SIDE * (PACK_SIDE + 1)];
  const int x = get_local_id(0) % PACK_SIDE, y = get_local_id(0) / PACK_SIDE;
  const int begin = get_group_id(2) * piece, width = min(piece, N - begin);
  const int k0 = get_group_id(1) * PACK_SIDE, n0 = get_group_id(0) * PACK_SIDE;
  const int dk = k_stride == 1 ? x : y, dn = k_stride == 1 ? y : x;
  if (k0 + dk < K && n0 + dn < width)
    tile[dk * (PACK_SIDE + 1) + dn] =
        w[offset + (size_t)(k0 + dk) * k_stride + ((size_t)first + begin + n0 + dn) * n_stride];
  barrier(CLK_LOCAL_MEM_FENCE);
  if (k0 + y < K && n0 + x < width)
    out[(size_t)begin * K + (size_t)(k0 + y) * width + n0 + x] = tile[y * (PACK_SIDE + 1) + x];
}

// The epilogue alone, after a library's GEMM: out = act(x + bias) + residual. x [M, N]; residual, out [.., N] from row row0 on; x may be
// those rows of out. One work-item per element.
kernel void gemm_epilogue(global const float* x, int x_row0, int M, int N, global const float* bias, int act,
                          global const float* residual, global float* out, int row0) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)M * N) return;
  const size_t at = (size_t)row0 * N + i;
  const float v = activate(x[(size_t)x_row0 * N + i] + (bias ? bias[i % N] : 0.0f), act);
  out[at] = residual ? v + residual[at] : v;
}
