// out = act(A B + bias) + residual, cpu flavour. A is packed first (gemm_pack_a), B once (gemm_pack_panels, or on the
// host); then each work-item of gemm_tile computes tiles of 12 rows by 32 columns of out. In mixed precision
// gemm_pack_pairs_cpu.cl packs both: words of two neighbouring terms of a sum (pairs_cpu.clh), for which gemm_tile is
// built with PAIRS.
#define PACK_ROWS 12
#ifdef BLOCK
#define TILE_STRIDE BLOCK
#endif
#include "pack_cpu.clh"
#include "term_tile_cpu.clh"

#ifndef PAIRS
// A, composed (compose_rows.cl says how, and what the arguments are) and packed, twelve rows at a time.
// ```
// argument    type  shape                    what
// x0 .. row0                                 as in compose_rows.cl; T = 1 without a map
// M           int                            rows of A
// panels      f32   [ceil(M/12),T,c0+c1,12]  written: A; rows beyond M are zero
// work-items  groups of one: (tap, panel)
// ```
kernel void gemm_pack_a(global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
                        global const float* shift, int silu, global const int* map, int T, int src_rows, int row0,
                        int M, global float* panels) {
  const int t = GROUP_ID(0);
  const int panel = GROUP_ID(1);
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

// Packs any matrix [K,N] on the device into panels of `width` columns. Its element (k, n) is
// w[offset + (first + k) k_stride + n n_stride].
// ```
// argument     type  shape                    what
// w            f32                            where the matrix lies
// out          f32   [ceil(N/width),K,width]  written: the panels; columns beyond N are zero
// define ROWS  64                             rows of a work-item
// work-items   groups of one: (panel, block of ROWS rows)
// ```
kernel void gemm_pack_panels(global const float* w, int offset, int first, int K, int N, int k_stride, int n_stride,
                             int width, global float* out) {
  const int n0 = GROUP_ID(0) * width, k0 = GROUP_ID(1) * ROWS;
  const int count = min(width, N - n0);
  for (int k = k0; k < min(K, k0 + ROWS); ++k) {
    global const float* from = w + offset + (size_t)(first + k) * k_stride + (size_t)n0 * n_stride;
    global float* to = out + ((size_t)GROUP_ID(0) * K + k) * width;
    if (n_stride == 1) {
      for (int j = 0; j < count; ++j) to[j] = from[j];
    } else {
      for (int j = 0; j < count; ++j) to[j] = from[(size_t)j * n_stride];
    }
    for (int j = count; j < width; ++j) to[j] = 0.0f;
  }
}
#endif

#define GEMM_PANELS 8

// tile += the products of `count` columns of A's panel at `a` with as many rows of B's at `b`: by pointers and several
// at once, so that there is little loop overhead beside the multiply-adds.
#ifdef BLOCK
#define PANEL_TERMS(K) (DIV_UP(K, BLOCK) * BLOCK)
#define TILE_RUN(a, b, count)                                                                                  \
  {                                                                                                            \
    global const Term* run_a_ = (a);                                                                           \
    global const Term* run_b_ = (b);                                                                           \
    int left_ = (count);                                                                                       \
    for (; left_ >= BLOCK; left_ -= BLOCK, run_a_ += BLOCK * TILE_ROWS) {                                      \
      _Pragma("unroll") for (int j_ = 0; j_ < BLOCK; ++j_, run_b_ += TILE_COLS) TILE_STEP(run_a_ + j_, run_b_) \
    }                                                                                                          \
    for (int j_ = 0; j_ < left_; ++j_, run_b_ += TILE_COLS) TILE_STEP(run_a_ + j_, run_b_)                     \
  }
#else
#define PANEL_TERMS(K) (K)
#define TILE_RUN(a, b, count)                                 \
  {                                                           \
    global const Term* run_a_ = (a);                          \
    global const Term* run_b_ = (b);                          \
    global const Term* run_end_ = run_a_ + (count)*TILE_ROWS; \
    _Pragma("unroll 4") while (run_a_ != run_end_) {          \
      TILE_STEP(run_a_, run_b_)                               \
      run_a_ += TILE_ROWS;                                    \
      run_b_ += TILE_COLS;                                    \
    }                                                         \
  }
#endif

// Sums of more than TILE_TERMS terms are computed slice by slice of K, each for a whole block of A's panels, so that
// B's slice stays in the first-level cache during the block.
// ```
// argument    type  shape              what
// panels      f32   [ceil(M/12),K,12]  A, from gemm_pack_a, or with a width of 12 from gemm_pack_panels. BLOCK:
//                                      [ceil(M/12),ceil(K/BLOCK),12,BLOCK], from gemm_pack_a_pairs
// b           f32   [ceil(N/32),K,32]  B, 32 columns at a time; columns beyond N are zero
// K           int                      terms; PAIRS: pairs of terms, and u32 in place of f32
// block       int                      panels of A that a work-item goes through; at most GEMM_PANELS if K >
//                                      TILE_TERMS
// bias        f32   [N]                null: none
// act         int                      0 none, 1 GELU, 2 SiLU
// residual    f32   [..,N]             from row row0 on; null: none; may be out
// out         f32   [..,N]             written: rows row0 .. row0 + M - 1
// define BLOCK  if A is packed by rows, in blocks: the terms of one; a multiple of it is TILE_TERMS
// work-items  groups of one: (panel of B, block of panels of A)
// ```
kernel void gemm_tile(global const Term* panels, global const Term* b, int block, int M, int N, int K,
                      global const float* bias, int act, global const float* residual, global float* out, int row0) {
  const int n0 = GROUP_ID(0) * TILE_COLS;
  const int first = GROUP_ID(1) * block, last = min(first + block, DIV_UP(M, TILE_ROWS));
  global const Term* pb = b + (size_t)n0 * K;
#ifndef TILE_LOOPS
  if (K > TILE_TERMS) {
    float16 sums[GEMM_PANELS * 2 * TILE_ROWS];
    for (int k = 0; k < K; k += TILE_TERMS) {
      const int until = min(K, k + TILE_TERMS);
      for (int panel = first; panel < last; ++panel) {
        global const Term* pa = panels + (size_t)panel * PANEL_TERMS(K) * TILE_ROWS;
        float16* tile_sums_ = sums + (panel - first) * 2 * TILE_ROWS;
        TILE_DECLARE
        TILE_RUN(pa + k * TILE_ROWS, pb + k * TILE_COLS, until - k)
        EACH_ROW(TILE_FOLD_ROW)
        if (until < K) continue;
        const int m = panel * TILE_ROWS;
        const size_t at = (size_t)(row0 + m) * N + n0;
        tile_finish(tile_sums_, min(TILE_ROWS, M - m), 2, n0, N, bias, act, residual ? residual + at : residual,
                    out + at);
      }
    }
    return;
  }
#endif
  for (int panel = first; panel < last; ++panel) {
    global const Term* pa = panels + (size_t)panel * PANEL_TERMS(K) * TILE_ROWS;
    TILE_DECLARE
    TILE_RUN(pa, pb, K)
    const int m = panel * TILE_ROWS;
    const size_t at = (size_t)(row0 + m) * N + n0;
    TILE_FINISH(min(TILE_ROWS, M - m), n0, N, bias, act, residual ? residual + at : residual, out + at);
  }
}
