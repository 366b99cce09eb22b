// The product of gemm_cpu.cl for an A that needs no composing, cpu flavour: A's rows are read in place. Packing them
// would take longer than the products if B has few columns. The results have the same bits.
// ```
// define COLUMNS  32   columns of a tile, 16, 24 or 32: only as many as out has in its last
// ```
#include "tile_cpu.clh"

#ifndef COLUMNS
#define COLUMNS 32
#endif
#define MOST_PANELS 8

// The tile of tile_cpu.clh, whose second half is as wide as COLUMNS leaves it: lo0, hi0 .. lo11, hi11.
#if COLUMNS == 32
#define IF_HIGH(x) x
#define HIGH float16
#define HIGH_LOAD(b) vload16(1, (b))
#define HIGH_PART(sum) sum
#elif COLUMNS == 24
#define IF_HIGH(x) x
#define HIGH float8
#define HIGH_LOAD(b) vload8(2, (b))
#define HIGH_PART(sum) sum.lo
#else
#define IF_HIGH(x)
#endif

#define DECLARE_ROW(i)             \
  float16 lo##i = (float16)(0.0f); \
  IF_HIGH(HIGH hi##i = (HIGH)(0.0f);)
#define STEP_ROW(i)                                \
  {                                                \
    const float a_ = a[(i)*far];                   \
    lo##i = FMA((float16)(a_), b_lo, lo##i);       \
    IF_HIGH(hi##i = FMA((HIGH)(a_), b_hi, hi##i);) \
  }
#define FOLD_ROW(i)                                  \
  tile[2 * (i)] = k ? tile[2 * (i)] + lo##i : lo##i; \
  IF_HIGH(HIGH_PART(tile[2 * (i) + 1]) = k ? HIGH_PART(tile[2 * (i) + 1]) + hi##i : hi##i;)

// out = act(A B + bias) + residual, with two sources side by side as A. Sums of more than TILE_TERMS terms are computed
// slice by slice of K, as in gemm_tile.
// ```
// argument    type  shape              what
// x0          f32   [..,c0]            A's columns up to c0, from row row0 on
// x1          f32   [..,c1]            those after it; null if c1 is 0
// b           f32   [ceil(N/32),K,32]  B, 32 columns at a time, K = c0 + c1; columns beyond N are zero
// block       int                      panels of twelve rows that a work-item goes through, at most MOST_PANELS
// M           int                      rows, at least twelve
// bias        f32   [N]                null: none
// act         int                      0 none, 1 GELU, 2 SiLU
// residual    f32   [..,N]             from row out_row0 on; null: none; may be out
// out         f32   [..,N]             written: rows out_row0 .. out_row0 + M - 1
// work-items  groups of one: (panel of B, block of panels of A); one panel of B if COLUMNS is less than 32
// ```
kernel void gemm_rows(global const float* x0, int c0, global const float* x1, int c1, int row0, global const float* b,
                      int block, int M, int N, global const float* bias, int act, global const float* residual,
                      global float* out, int out_row0) {
  const int n0 = GROUP_ID(0) * TILE_COLS, K = c0 + c1;
  const int first = GROUP_ID(1) * block, last = min(first + block, DIV_UP(M, TILE_ROWS));
  float16 sums[MOST_PANELS * 2 * TILE_ROWS];
  for (int k = 0; k < K; k += TILE_TERMS) {
    const int until = min(K, k + TILE_TERMS);
    for (int panel = first; panel < last; ++panel) {
      // The last twelve rows may overlap those of the panel before, which are not written again.
      const int m = min(panel * TILE_ROWS, M - TILE_ROWS), skip = panel * TILE_ROWS - m;
      float16* tile = sums + (panel - first) * 2 * TILE_ROWS;
      EACH_ROW(DECLARE_ROW)
      for (int source = 0; source < 2; ++source) {
        const int base = source ? c0 : 0, width = source ? c1 : c0;
        const int from = max(k - base, 0), to = min(until - base, width);
        if (from >= to) continue;
        const size_t far = width;
        global const float* a = (source ? x1 : x0) + (row0 + m) * far + from;
        global const float* end = a + (to - from);
        global const float* pb = b + (size_t)n0 * K + (size_t)(base + from) * TILE_COLS;
        // Twelve short rows are more streams than a processor prefetches by itself. So this prefetches the next panel,
        // which follows this one directly in memory if whole rows are read.
        global const float* next = a + TILE_ROWS * far;
        const int step = to - from == width ? TILE_ROWS : 0;
#pragma unroll 4
        for (; a != end; ++a, pb += TILE_COLS, next += step) {
          const float16 b_lo = vload16(0, pb);
          IF_HIGH(const HIGH b_hi = HIGH_LOAD(pb);)
          PREFETCH(next)
          EACH_ROW(STEP_ROW)
        }
      }
      EACH_ROW(FOLD_ROW)
      if (until < K) continue;
      const size_t at = (size_t)(out_row0 + m + skip) * N + n0;
      tile_finish(tile + 2 * skip, TILE_ROWS - skip, DIV_UP(COLUMNS, 16), n0, N, bias, act,
                  residual ? residual + at : residual, out + at);
    }
  }
}
