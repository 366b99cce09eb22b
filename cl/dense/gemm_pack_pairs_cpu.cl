// Packs the operands of products in mixed precision, cpu flavour: numbers are rounded, and a word holds two
// neighbouring terms of a sum (pairs_cpu.clh). A is packed by rows, in blocks of 16 pairs, B by panels of columns.
// ```
// define PANEL_ROWS  12  rows of a panel of A: of gemm_tile's tile; 32 for that of gemm_amx_cpu.cl
// ```
#ifndef PAIRS
#define PAIRS
#endif
#include "common.clh"
#include "pairs_cpu.clh"
#include "tile_cpu.clh"
#include "transpose_cpu.clh"

#ifndef PANEL_ROWS
#define PANEL_ROWS 12
#endif
#define BLOCK 16  // pairs

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

// A, composed (compose_rows.cl says how, and what the arguments are) and packed.
// ```
// argument    type  shape                                          what
// x0 .. row0                                                       as in compose_rows.cl; T = 1 without a map
// M           int                                                  rows of A
// panels      u32   [ceil(M/PANEL_ROWS),ceil(K/32),PANEL_ROWS,16]  written: A, K = T (c0 + c1) terms; zero beyond M and
//                                                                  K
// work-items  groups of one: panels
// ```
kernel void gemm_pack_a_pairs(global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
                              global const float* shift, int silu_too, global const int* map, int T, int src_rows,
                              int row0, int M, global uint* panels) {
  const int C = c0 + c1, K = T * C, blocks = DIV_UP(K, 2 * BLOCK), m0 = GROUP_ID(0) * PANEL_ROWS;
  global uint* to = panels + (size_t)m0 * blocks * BLOCK;
  int t = 0, c = 0;  // tap and channel of term k
  for (int k = 0; k < 2 * BLOCK * blocks; k += 16) {
    const int second = c >= c0;
    const int width = second ? C - c : c0 - c;  // numbers to the end of the source
    const int whole = k < K && (width >= 16 || k + width == K);
    global const float* from = second ? x1 + c - c0 : x0 + c;
    const int step = second ? c1 : c0;
    float16 a = (float16)(1.0f), b = (float16)(0.0f);
    if (scale && whole) a = load_part(scale + c, width), b = load_part(shift + c, width);
    for (int i = 0; i < PANEL_ROWS; ++i) {
      global uint* at = to + (k / 32 * PANEL_ROWS + i) * BLOCK + k / 2 % BLOCK;
      const int m = m0 + i;
      if (m >= M || k >= K) {
        vstore8((uint8)(0u), 0, at);
      } else if (whole) {
        const int r = map ? map[(size_t)(row0 + m) * T + t] : row0 + m;
        float16 v = (float16)(0.0f);
        if (r >= 0 && r < src_rows) {
          v = load_part(from + (size_t)r * step, width);
          if (scale) v = FMA(v, a, b);
          if (silu_too) v = silu_16(v);
        }
        vstore8(pairs_along(v), 0, at);
      } else {
        global const int* rows = map ? map + (size_t)(row0 + m) * T : 0;
        for (int j = 0; j < 16; j += 2)
          at[j / 2] =
              pair_of(composed_at(x0, c0, x1, c1, scale, shift, silu_too, rows, row0 + m, T, src_rows, k + j),
                      composed_at(x0, c0, x1, c1, scale, shift, silu_too, rows, row0 + m, T, src_rows, k + j + 1));
      }
    }
    for (c += 16; c >= C && t < T; c -= C) ++t;
  }
}

#define ROWS 64  // pairs

// Writes the first `width` words of v.
static inline void store_words(uint16 v, int width, global uint* to) {
  if (width >= 16) {
    vstore16(v, 0, to);
  } else if (width == 12) {
    vstore8(v.lo, 0, to);
    vstore4(v.hi.lo, 0, to + 8);
  } else {
    uint values[16];
    vstore16(v, 0, values);
    for (int i = 0; i < width; ++i) to[i] = values[i];
  }
}

// The 16 pairs of `terms` numbers `step` apart, or of the first 32 of them.
static inline uint16 column_pairs(global const float* from, int step, int terms) {
  if (step == 1) return (uint16)(pairs_along(load_part(from, terms)), pairs_along(load_part(from + 16, terms - 16)));
  uint values[16];
  for (int k = 0; k < 16; ++k) {
    global const float* one = from + (size_t)(2 * k) * step;
    values[k] = 2 * k < terms ? pair_of(one[0], 2 * k + 1 < terms ? one[step] : 0.0f) : 0u;
  }
  return vload16(0, values);
}

// Packs any matrix [K,N] on the device into panels of `width` columns. Its element (k, n) is
// w[offset + (first + k) k_stride + n n_stride].
// ```
// argument    type  shape                            what
// w           f32                                    where the matrix lies
// out         u32   [ceil(N/width),ceil(K/2),width]  written: the panels; columns beyond N are zero
// work-items  groups of one: (panel, block of 64 pairs of rows)
// ```
kernel void gemm_pack_panels_pairs(global const float* w, int offset, int first, int K, int N, int k_stride,
                                   int n_stride, int width, global uint* out) {
  const int n0 = GROUP_ID(0) * width, pairs = DIV_UP(K, 2), from_k = GROUP_ID(1) * ROWS;
  w += offset + (size_t)first * k_stride + (size_t)n0 * n_stride;
  out += (size_t)GROUP_ID(0) * pairs * width;
  for (int k0 = from_k; k0 < min(pairs, from_k + ROWS); k0 += 16)
    for (int j = 0; j < width; j += 16) {
      const int columns = N - n0 - j, here = min(16, pairs - k0);  // columns: below 1 beyond the last one
      if (n_stride == 1) {
        for (int k = k0; k < k0 + here; ++k) {
          global const float* one = w + (size_t)(2 * k) * k_stride + j;
          const float16 other = load_part(one + k_stride, 2 * k + 1 < K ? columns : 0);
          store_words(pairs_of(load_part(one, columns), other), width - j, out + k * width + j);
        }
      } else {
        float16 r[16];  // bits of a column's pairs
        for (int i = 0; i < 16; ++i) {
          r[i] = (float16)(0.0f);
          if (i < min(columns, width - j))
            r[i] = as_float16(
                column_pairs(w + (size_t)(2 * k0) * k_stride + (size_t)(j + i) * n_stride, k_stride, K - 2 * k0));
        }
        transpose_16(r);
        for (int k = 0; k < here; ++k) store_words(as_uint16(r[k]), width - j, out + (k0 + k) * width + j);
      }
    }
}
