// out = act(A B + bias) + residual, cpu flavour, in mixed precision by AMX (amx.clh). As in gemm_cpu.cl, A is packed
// first and B once, in the same format; then each work-item computes tiles of 32 rows by 32 columns of out.
// targets: x86:amx
#ifndef PAIRS
#define PAIRS
#endif
#define PACK_ROWS 12  // of pack_cpu.clh, which lends its transposition
#include "amx.clh"
#include "pack_cpu.clh"

#define PANEL_ROWS 32
#define BLOCK 16  // pairs
#define PACK_LINES 8

// Where pair k of a panel's row is.
static inline size_t packed_at(int row, int k) { return ((size_t)(k / BLOCK) * PANEL_ROWS + row) * BLOCK + k % BLOCK; }

// Number k of a composed row; zero beyond its K = T (c0 + c1) numbers.
static inline float composed_at(global const float* x0, int c0, global const float* x1, int c1,
                                global const float* scale, global const float* shift, int silu_too,
                                global const int* rows, int row, int T, int src_rows, int k) {
  const int C = c0 + c1, t = k / C, c = k % C;
  if (t >= T) return 0.0f;
  const int r = rows ? rows[t] : row;
  if (r < 0 || r >= src_rows) return 0.0f;
  float v = c < c0 ? x0[(size_t)r * c0 + c] : x1[(size_t)r * c1 + c - c0];
  if (scale) v = FMA(v, scale[c], shift[c]);
  return silu_too ? silu(v) : v;
}

// A, composed (compose_rows.cl says how, and what the arguments are) and packed: 32 rows at a time, in blocks of 16
// pairs of neighbouring terms, each a register's content.
// ```
// argument    type  shape                                  what
// x0 .. row0                                               as in compose_rows.cl; T = 1 without a map
// M           int                                          rows of A
// panels      u32   [ceil(M/32),ceil(T(c0+c1)/32),32,16]   written: A; zero beyond M and beyond the last term
// work-items  groups of one: (8 of a panel's rows, panel)
// ```
kernel void gemm_amx_pack_a(global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
                            global const float* shift, int silu_too, global const int* map, int T, int src_rows,
                            int row0, int M, global uint* panels) {
  const int C = c0 + c1, K = T * C, pairs = DIV_UP(K, 2 * BLOCK) * BLOCK;
  global uint* to = panels + (size_t)GROUP_ID(1) * pairs * PANEL_ROWS;
  for (int i = GROUP_ID(0) * PACK_LINES; i < (GROUP_ID(0) + 1) * PACK_LINES; ++i) {
    const int m = GROUP_ID(1) * PANEL_ROWS + i;
    global const int* rows = map && m < M ? map + (size_t)(row0 + m) * T : 0;
    for (int k = 0; k < 2 * pairs; k += 16) {
      const size_t at = packed_at(i, k / 2);
      const int t = k / C, c = k % C, r = m >= M || t >= T ? -1 : rows ? rows[t] : row0 + m;
      const int second = c >= c0;
      const int width = second ? C - c : c0 - c;  // numbers to the end of the source
      if (m >= M || k >= K) {
        vstore8((uint8)(0u), 0, to + at);
      } else if (width >= 16 || k + width == K) {
        float16 v = (float16)(0.0f);
        if (r >= 0 && r < src_rows) {
          v = load_part(second ? x1 + (size_t)r * c1 + c - c0 : x0 + (size_t)r * c0 + c, width);
          if (scale) v = FMA(v, load_part(scale + c, width), load_part(shift + c, width));
          if (silu_too) v = silu_16(v);
        }
        vstore8(pairs_along(v), 0, to + at);
      } else {
        for (int j = 0; j < 16; j += 2)
          to[at + j / 2] =
              pair_of(composed_at(x0, c0, x1, c1, scale, shift, silu_too, rows, row0 + m, T, src_rows, k + j),
                      composed_at(x0, c0, x1, c1, scale, shift, silu_too, rows, row0 + m, T, src_rows, k + j + 1));
      }
    }
  }
}

// Packs the columns of a matrix [K, M] as A, for the product of its transpose. Its element (k, m) is
// w[(first + k) M + m].
// ```
// argument    type  shape                           what
// w           f32   [..,M]
// panels      u32   [ceil(M/32),ceil(K/32),32,16]   written: A; zero beyond M and beyond K
// work-items  groups of one: (block of 32 rows of w, half of a panel)
// ```
kernel void gemm_amx_pack_columns(global const float* w, int first, int K, int M, global uint* panels) {
  const int block = GROUP_ID(0), m0 = GROUP_ID(1) * 16, width = M - m0;
  float16 r[BLOCK];  // bits of pairs
  for (int i = 0; i < BLOCK; ++i) {
    const int k = 2 * (block * BLOCK + i);
    global const float* from = w + (size_t)(first + k) * M + m0;
    const float16 one = load_part(from, k < K ? width : 0), other = load_part(from + M, k + 1 < K ? width : 0);
    r[i] = as_float16(pairs_of(one, other));
  }
  transpose_16(r);
  global uint* to = panels + ((size_t)(m0 / PANEL_ROWS) * DIV_UP(K, 2 * BLOCK) + block) * PANEL_ROWS * BLOCK;
  for (int i = 0; i < 16; ++i) vstore16(as_uint16(r[i]), 0, to + (m0 % PANEL_ROWS + i) * BLOCK);
}

#define GEMM_PANELS 8
#define SLICE 16  // blocks of B, which stay in the first-level cache for all panels of A

// ```
// argument    type  shape                        what
// panels      u32   [ceil(M/32),ceil(K/16),32,16] A, from gemm_amx_pack_a or gemm_amx_pack_columns
// b           u32   [ceil(N/32),K,32]             B, from gemm_pack_panels; columns beyond N are zero
// K           int                                 pairs of terms
// block       int                                 panels of A that a work-item goes through; at most GEMM_PANELS
// bias .. row0                                    as in gemm_cpu.cl
// work-items  groups of one: (panel of B, block of panels of A)
// ```
kernel void gemm_amx_tile(global const uint* panels, global const uint* b, int block, int M, int N, int K,
                          global const float* bias, int act, global const float* residual, global float* out,
                          int row0) {
  const int n0 = GROUP_ID(0) * TILE_COLS, first = GROUP_ID(1) * block, last = min(first + block, DIV_UP(M, PANEL_ROWS));
  const int blocks = DIV_UP(K, BLOCK), whole = K / BLOCK;
  global const uint* pb = b + (size_t)n0 * K;
  uint tail[BLOCK * TILE_COLS];  // the last block of B, if it is not whole
  for (int i = 0; i < BLOCK * TILE_COLS; ++i) tail[i] = 0u;
  for (int i = 0; i < K % BLOCK * TILE_COLS; ++i) tail[i] = pb[whole * BLOCK * TILE_COLS + i];
  float16 sums[GEMM_PANELS * 2 * PANEL_ROWS];
  AmxShapes shapes;
  amx_full_shapes(&shapes);
  AMX_BEGIN(&shapes)
  for (int k0 = 0; k0 == 0 || k0 < blocks; k0 += SLICE) {
    const int until = min(blocks, k0 + SLICE);
    for (int panel = first; panel < last; ++panel) {
      float16* tile = sums + (panel - first) * 2 * PANEL_ROWS;
      float* t = (float*)tile;
      if (k0 == 0) {
        AMX_ZERO_32
      } else {
        AMX_LOAD_32(t, TILE_COLS)
      }
      global const uint* a = panels + ((size_t)panel * blocks + k0) * PANEL_ROWS * BLOCK;
      global const uint* from = pb + k0 * BLOCK * TILE_COLS;
      for (int k = k0; k < min(until, whole); ++k) {
        AMX_MULTIPLY_32(a, from)
        a += PANEL_ROWS * BLOCK;
        from += BLOCK * TILE_COLS;
      }
      if (until > whole) {
        AMX_MULTIPLY_32(a, tail)
      }
      AMX_STORE_32(t, TILE_COLS)
      if (until < blocks) continue;
      const int m = panel * PANEL_ROWS;
      const size_t at = (size_t)(row0 + m) * N + n0;
      tile_finish(tile, min(PANEL_ROWS, M - m), 2, n0, N, bias, act, residual ? residual + at : residual, out + at);
    }
  }
  AMX_END
}
