// out = act(A B + bias) + residual, cpu flavour, in mixed precision by AMX (amx.clh). gemm_pack_pairs_cpu.cl packs A,
// with PANEL_ROWS 32, and B; then each work-item computes tiles of 32 rows by 32 columns of out.
// targets: x86:amx
#ifndef PAIRS
#define PAIRS
#endif
#include "amx.clh"
#include "term_tile_cpu.clh"
#include "transpose_cpu.clh"

#define PANEL_ROWS 32
#define BLOCK 16  // pairs

// Packs the columns of a matrix [K,M] as A, for the product of its transpose, by panels of 32 rows. Its element (k, m)
// is w[(first + k) M + m].
// ```
// argument    type  shape                          what
// w           f32   [..,M]
// panels      u32   [ceil(M/32),ceil(K/32),32,16]  written: A; zero beyond M and beyond K
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
  global uint* to = panels + ((size_t)(m0 / 32) * DIV_UP(K, 2 * BLOCK) + block) * 32 * BLOCK;
  for (int i = 0; i < 16; ++i) vstore16(as_uint16(r[i]), 0, to + (m0 % 32 + i) * BLOCK);
}

#define GEMM_PANELS 8
#define SLICE 16  // blocks of B, which stay in the first-level cache for all panels of A

// ```
// argument    type  shape                        what
// panels      u32   [ceil(M/32),ceil(K/16),32,16] A, from gemm_pack_a_pairs or gemm_amx_pack_columns
// b           u32   [ceil(N/32),K,32]             B, from gemm_pack_panels_pairs; columns beyond N are zero
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
  AMX_BEGIN_FULL
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
