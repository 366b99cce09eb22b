// out = act(A B + bias) + residual, cpu flavour. A is packed first (gemm_pack_a), then each work-item owns a tile of out.
//   panels [ceil(M/12), K, 12]   A, twelve rows at a time; rows beyond M are zero
//   b      [ceil(N/32), K, 32]   B, 32 columns at a time; columns beyond N are zero (packed on the host)
//   bias [N] or null; residual, out [M, N]; residual may be out itself. act: 0 none, 1 GELU, 2 SiLU.
#include "tile_cpu.clh"

// Four perfect shuffles of 16 x 16 numbers turn rows into columns.
static inline void transpose_16(float16* r) {
#pragma unroll
  for (int round = 0; round < 4; ++round) {
    float16 s[16];
#pragma unroll
    for (int i = 0; i < 8; ++i) {
      const float16 a = r[i], b = r[i + 8];
      s[2 * i] = (float16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7, b.s7);
      s[2 * i + 1] =
          (float16)(a.s8, b.s8, a.s9, b.s9, a.sa, b.sa, a.sb, b.sb, a.sc, b.sc, a.sd, b.sd, a.se, b.se, a.sf, b.sf);
    }
#pragma unroll
    for (int i = 0; i < 16; ++i) r[i] = s[i];
  }
}

// Channels [0, count) of twelve source rows of x [.., count], to[c * 12 + i]. row[i] < 0: zeros. scale and shift: of these channels.
static inline void pack_rows(__global const float* x, int count, const int* row, __global const float* scale,
                             __global const float* shift, int silu, __global float* to) {
  for (int c = 0; c < count; c += 16) {
    const int width = min(16, count - c);
    float16 r[16];
#pragma unroll
    for (int i = TILE_ROWS; i < 16; ++i) r[i] = (float16)(0.0f);
    if (width == 16) {
#pragma unroll
      for (int i = 0; i < TILE_ROWS; ++i)
        r[i] = row[i] < 0 ? (float16)(0.0f) : vload16(0, x + (size_t)max(row[i], 0) * count + c);
    } else {
      for (int i = 0; i < TILE_ROWS; ++i) {
        float v[16];
        for (int j = 0; j < 16; ++j) v[j] = j < width && row[i] >= 0 ? x[(size_t)row[i] * count + c + j] : 0.0f;
        r[i] = vload16(0, v);
      }
    }
    if (scale) {
      float16 a, b;
      if (width == 16) {
        a = vload16(0, scale + c);
        b = vload16(0, shift + c);
      } else {
        float v[16], w[16];
        for (int j = 0; j < 16; ++j) {
          v[j] = j < width ? scale[c + j] : 0.0f;
          w[j] = j < width ? shift[c + j] : 0.0f;
        }
        a = vload16(0, v);
        b = vload16(0, w);
      }
#pragma unroll
      for (int i = 0; i < TILE_ROWS; ++i)
        if (row[i] >= 0) r[i] = FMA(r[i], a, b);
    }
    if (silu) {
#pragma unroll
      for (int i = 0; i < TILE_ROWS; ++i) r[i] = silu_16(r[i]);  // of an absent row's 0 is 0
    }
    transpose_16(r);
    if (width == 16) {
#pragma unroll
      for (int j = 0; j < 16; ++j) {
        vstore8(r[j].lo, 0, to + (c + j) * TILE_ROWS);
        vstore4(r[j].hi.lo, 0, to + (c + j) * TILE_ROWS + 8);
      }
    } else {
      for (int j = 0; j < width; ++j) {
        vstore8(r[j].lo, 0, to + (c + j) * TILE_ROWS);
        vstore4(r[j].hi.lo, 0, to + (c + j) * TILE_ROWS + 8);
      }
    }
  }
}

// A composed and packed. Row m in [0, M) is, for each of T taps, the source row map[row0 + m, t] (row0 + m where map is null): x0's c0
// channels, then x1's c1; with scale v * scale[c] + shift[c]; with silu v / (1 + exp(-v)). A source row outside [0, src_rows) is zero
// after all that.
//   x0 [src_rows, c0]; x1 [src_rows, c1] or null; scale, shift [c0 + c1] or null; map [.., T] or null
//   panels [ceil(M/12), T, c0 + c1, 12]
// Work-groups of one work-item: (tap, panel).
__kernel void gemm_pack_a(__global const float* x0, int c0, __global const float* x1, int c1, __global const float* scale,
                          __global const float* shift, int silu, __global const int* map, int T, int src_rows, int row0,
                          int M, __global float* panels) {
  const int t = get_group_id(0);
  const int panel = get_group_id(1);
  int row[TILE_ROWS];
  for (int i = 0; i < TILE_ROWS; ++i) {
    const int m = panel * TILE_ROWS + i;
    int r = -1;
    if (m < M) r = map ? map[(size_t)(row0 + m) * T + t] : row0 + m;
    row[i] = r < src_rows ? r : -1;
  }
  const int C = c0 + c1;
  __global float* to = panels + ((size_t)panel * T + t) * C * TILE_ROWS;
  pack_rows(x0, c0, row, scale, shift, silu, to);
  if (c1) pack_rows(x1, c1, row, scale ? scale + c0 : scale, scale ? shift + c0 : shift, silu, to + c0 * TILE_ROWS);
}

// Work-groups of one work-item: (panel of A, panel of B), so that a panel of B stays in cache while A's stream by.
// out and residual start at row row0.
__kernel void gemm_tile(__global const float* panels, __global const float* b, int M, int N, int K,
                        __global const float* bias, int act, __global const float* residual, __global float* out, int row0) {
  const int panel = get_group_id(0);
  const int n0 = get_group_id(1) * TILE_COLS;
  __global const float* pa = panels + (size_t)panel * K * TILE_ROWS;
  __global const float* pb = b + (size_t)n0 * K;
  TILE_DECLARE
  for (int k = 0; k < K; ++k) TILE_STEP(pa + k * TILE_ROWS, pb + k * TILE_COLS)
  float16 t[2 * TILE_ROWS];
  TILE_STORE(t)
  const int m = panel * TILE_ROWS;
  const size_t at = (size_t)(row0 + m) * N + n0;
  tile_finish(t, min(TILE_ROWS, M - m), 2, n0, N, bias, act, residual ? residual + at : residual, out + at);
}
