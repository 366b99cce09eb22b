// out = act(A B + bias) + residual, cpu flavour. A is packed first (gemm_pack_a), then each work-item owns a tile of out.
//   panels [ceil(M/12), K, 12]   A, twelve rows at a time; rows beyond M are zero
//   b      [ceil(N/32), K, 32]   B, 32 columns at a time; columns beyond N are zero (packed on the host)
//   bias [N] or null; residual, out [.., N] from row row0 on; residual may be out itself. act: 0 none, 1 GELU, 2 SiLU.
#define PACK_ROWS 12
#include "pack_cpu.clh"

// A composed and packed. Row m in [0, M) is, for each of T taps, the source row map[row0 + m, t] (row0 + m where map is null): x0's c0
// channels, then x1's c1; with scale v * scale[c] + shift[c]; with silu v / (1 + exp(-v)). A source row outside [0, src_rows) is zero
// after all that.
//   x0 [src_rows, c0]; x1 [src_rows, c1] or null; scale, shift [c0 + c1] or null; map [.., T] or null
//   panels [ceil(M/12), T, c0 + c1, 12]
// Work-groups of one work-item: (tap, panel).
kernel void gemm_pack_a(global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
                        global const float* shift, int silu, global const int* map, int T, int src_rows, int row0,
                        int M, global float* panels) {
  const int t = get_group_id(0);
  const int panel = get_group_id(1);
  int row[PACK_ROWS];
  for (int i = 0; i < PACK_ROWS; ++i) {
    const int m = panel * PACK_ROWS + i;
    int r = -1;
    if (m < M) r = map ? map[(size_t)(row0 + m) * T + t] : row0 + m;
    row[i] = r < src_rows ? r : -1;
  }
  pack_sources(x0, c0, x1, c1, row, scale, shift, silu, panels + ((size_t)panel * T + t) * (c0 + c1) * PACK_ROWS);
}

#ifndef ROWS
#define ROWS 64
#endif

// Panels of `width` columns of any matrix [K, N] on the device: element (k, n) is w[offset + (first + k) * k_stride + n * n_stride].
//   out [ceil(N / width), K, width], zeros beyond N
// Work-groups of one work-item: (panel, ROWS rows).
kernel void gemm_pack_panels(global const float* w, int offset, int first, int K, int N, int k_stride, int n_stride,
                             int width, global float* out) {
  const int n0 = get_group_id(0) * width, k0 = get_group_id(1) * ROWS;
  const int count = min(width, N - n0);
  for (int k = k0; k < min(K, k0 + ROWS); ++k) {
    global const float* from = w + offset + (size_t)(first + k) * k_stride + (size_t)n0 * n_stride;
    global float* to = out + ((size_t)get_group_id(0) * K + k) * width;
    if (n_stride == 1) {
      for (int j = 0; j < count; ++j) to[j] = from[j];
    } else {
      for (int j = 0; j < count; ++j) to[j] = from[(size_t)j * n_stride];
    }
    for (int j = count; j < width; ++j) to[j] = 0.0f;
  }
}

// Work-groups of one work-item: (panel of B, block of `block` panels of A), so that a block of A stays in cache while B's panels stream by.
kernel void gemm_tile(global const float* panels, global const float* b, int block, int M, int N, int K,
                      global const float* bias, int act, global const float* residual, global float* out, int row0) {
  const int n0 = get_group_id(0) * TILE_COLS;
  const int last = min((int)(get_group_id(1) + 1) * block, DIV_UP(M, TILE_ROWS));
  for (int panel = get_group_id(1) * block; panel < last; ++panel) {
    global const float* pa = panels + (size_t)panel * K * TILE_ROWS;
    global const float* pb = b + (size_t)n0 * K;
    TILE_DECLARE
    TILE_SUM(K, pa + k * TILE_ROWS, pb + k * TILE_COLS)
    const int m = panel * TILE_ROWS;
    const size_t at = (size_t)(row0 + m) * N + n0;
    TILE_FINISH(min(TILE_ROWS, M - m), n0, N, bias, act, residual ? residual + at : residual, out + at);
  }
}
