// out = act(A B + bias) + residual, gpu flavour: tiles through local memory; A is composed while it is loaded.
struct Rows {
  global const int* map;
  int row0, T;
};
struct Source {
  int row;
};
static inline struct Source source_of(const struct Rows* r, int m) {
  const struct Source out = {r->row0 + m};
  return out;
}
static inline int step_of(const struct Rows* r, int t) { return 0; }
static inline int source_row(const struct Rows* r, const struct Source* of, int step, int t) {
  return r->map ? r->map[(size_t)of->row * r->T + t] : of->row;
}
#include "tile_gpu.clh"

// ```
// argument    type  shape         what
// x0 .. row0                      A, composed: as in compose_rows.cl
// b           f32   [T(c0+c1),N]  B
// M, N        int                 rows and columns of the result
// bias        f32   [N]           null: none
// act         int                 0 none, 1 GELU, 2 SiLU
// residual    f32   [..,N]        from row out_row0 on; null: none; may be out
// out         f32   [..,N]        written: rows out_row0 .. out_row0 + M - 1
// work-items  groups of SIDE SIDE: (tile of columns, tile of rows), see tile_gpu.clh
// ```
kernel MANY_REGISTERS FOUR_WAVES __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void gemm_tile_gpu(
    global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
    global const float* shift, int silu_a, global const int* map, int T, int src_rows, int row0, global const float* b,
    int M, int N, global const float* bias, int act, global const float* residual, global float* out, int out_row0) {
  local float4 work[WORK];
  const struct Rows rows = {map, row0, T};
  tile_gpu(work, x0, c0, x1, c1, scale, shift, silu_a, &rows, T, src_rows, b, M, N, bias, act, residual, out, out_row0,
           ALL_TERMS);
}

// The same for long sums and a result of few tiles: computes the sums in parts of `terms` terms, without bias,
// activation and residual. x0 .. b as above; gemm_split_sum adds the parts up.
// ```
// argument    type  shape    what
// M, N        int            rows and columns of the result
// terms       int            terms of a part: a multiple of 16
// parts       f32   [s,M,N]  written
// work-items  groups of SIDE SIDE: (tile of columns, tile of rows, s)
// ```
kernel MANY_REGISTERS FOUR_WAVES __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void gemm_split_gpu(
    global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
    global const float* shift, int silu_a, global const int* map, int T, int src_rows, int row0, global const float* b,
    int M, int N, int terms, global float* parts) {
  local float4 work[WORK];
  const struct Rows rows = {map, row0, T};
  const int s = GROUP_ID(2);
  tile_gpu(work, x0, c0, x1, c1, scale, shift, silu_a, &rows, T, src_rows, b, M, N, 0, 0, 0, parts, s * M, s * terms,
           (s + 1) * terms);
}

// out = act(the sum of the parts, in their order, + bias) + residual.
// ```
// argument    type  shape        what
// parts       f32   [count,M,N]
// bias .. out_row0               as in gemm_tile_gpu
// work-items  one per element
// ```
kernel void gemm_split_sum(global const float* parts, int count, int M, int N, global const float* bias, int act,
                           global const float* residual, global float* out, int out_row0) {
  const size_t i = get_global_id(0), all = (size_t)M * N;
  if (i >= all) return;
  float sum = bias ? bias[i % N] : 0.0f;
  for (int s = 0; s < count; ++s) sum += parts[s * all + i];
  const size_t at = (size_t)out_row0 * N + i;
  const float v = activate(sum, act);
  out[at] = residual ? v + residual[at] : v;
}

// parts[s] = A^T B over the rows [s chunk, (s + 1) chunk) of A and B, + residual: a long sum over rows, in parts.
// ```
// argument    type  shape      what
// at          f32   [s][M,..]  A's rows as columns: for every s in turn [M, min(chunk, rows - s chunk)]
// b           f32   [..,N]     rows from `first` on are used, `rows` in all
// residual    f32   [M,N]      null: none; else there is one part, and it may be parts
// parts       f32   [..,M,N]   written
// work-items  groups of SIDE SIDE: (tile of columns, tile of rows, s)
// ```
kernel MANY_REGISTERS FOUR_WAVES __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void gemm_transposed_gpu(
    global const float* at, global const float* b, int first, int rows, int chunk, int M, int N,
    global const float* residual, global float* parts) {
  local float4 work[WORK];
  const int s = GROUP_ID(2);
  const struct Rows plain = {0, 0, 1};
  tile_gpu(work, at + (size_t)s * chunk * M, min(chunk, rows - s * chunk), 0, 0, 0, 0, 0, &plain, 1, M,
           b + ((size_t)first + (size_t)s * chunk) * N, M, N, 0, 0, residual, parts, s * M, ALL_TERMS);
}

#ifndef PACK_SIDE
#define PACK_SIDE 16
#endif

// Splits any matrix [K,N] on the device into matrices of `piece` columns, one after the other (the last may have
// fewer). Its element (k, n) is w[offset + k k_stride + (first + n) n_stride]. It goes through local memory, so that
// neighbouring work-items read and write neighbouring numbers where a stride is 1.
// ```
// argument          type  shape          what
// w                 f32                  where the matrix lies
// out               f32   [K,piece], ..  written
// define PACK_SIDE                       16, or 8 if groups are small
// work-items        groups of PACK_SIDE PACK_SIDE: (so many columns, so many rows, piece)
// ```
kernel __attribute__((reqd_work_group_size(PACK_SIDE * PACK_SIDE, 1, 1))) void gemm_pack_plain(
    global const float* w, int offset, int first, int K, int N, int k_stride, int n_stride, int piece,
    global float* out) {
  local float tile[PACK_SIDE * (PACK_SIDE + 1)];
  const int x = get_local_id(0) % PACK_SIDE, y = get_local_id(0) / PACK_SIDE;
  const int begin = GROUP_ID(2) * piece, width = min(piece, N - begin);
  const int k0 = GROUP_ID(1) * PACK_SIDE, n0 = GROUP_ID(0) * PACK_SIDE;
  const int dk = k_stride == 1 ? x : y, dn = k_stride == 1 ? y : x;
  if (k0 + dk < K && n0 + dn < width)
    tile[dk * (PACK_SIDE + 1) + dn] =
        w[offset + (size_t)(k0 + dk) * k_stride + ((size_t)first + begin + n0 + dn) * n_stride];
  barrier(CLK_LOCAL_MEM_FENCE);
  if (k0 + y < K && n0 + x < width)
    out[(size_t)begin * K + (size_t)(k0 + y) * width + n0 + x] = tile[y * (PACK_SIDE + 1) + x];
}

// The step after a product that a library computed: out = act(x + bias) + residual.
// ```
// argument    type  shape   what
// x           f32   [..,N]  the product, from row x_row0 on; may be the rows of out
// bias        f32   [N]     null: none
// residual    f32   [..,N]  from row row0 on; null: none
// out         f32   [..,N]  written: rows row0 .. row0 + M - 1
// work-items  one per element
// ```
kernel void gemm_epilogue(global const float* x, int x_row0, int M, int N, global const float* bias, int act,
                          global const float* residual, global float* out, int row0) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)M * N) return;
  const size_t at = (size_t)row0 * N + i;
  const float v = activate(x[(size_t)x_row0 * N + i] + (bias ? bias[i % N] : 0.0f), act);
  out[at] = residual ? v + residual[at] : v;
}
