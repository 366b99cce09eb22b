// out = act(A B + bias) + residual, gpu flavour. A work-group of 16 x 16 computes a (16 RM) x (16 RN) tile of out through local memory,
// each work-item RM x RN of it; A's rows are composed while they are loaded.
//   Row m in [0, M) of A is, for each of T taps, the source row map[row0 + m, t] (row0 + m where map is null): x0's c0 channels, then x1's
//   c1; with scale v * scale[c] + shift[c]; with silu v / (1 + exp(-v)). A source row outside [0, src_rows) is zero after all that.
//   x0 [src_rows, c0]; x1 [src_rows, c1] or null; scale, shift [c0 + c1] or null; map [.., T] or null; b [T (c0 + c1), N]
//   bias [N] or null; residual, out [.., N] from row out_row0 on; residual may be null or out itself. act: 0 none, 1 GELU, 2 SiLU.
#include "common.clh"

#ifndef RM
#define RM 4  // rows per work-item
#endif
#ifndef RN
#define RN 4  // columns per work-item
#endif
#define SIDE 16
#define BM (SIDE * RM)
#define BN (SIDE * RN)
#define BK 16  // steps of k between barriers

__kernel __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void gemm_tile_gpu(
    __global const float* x0, int c0, __global const float* x1, int c1, __global const float* scale, __global const float* shift,
    int silu_a, __global const int* map, int T, int src_rows, int row0, __global const float* b, int M, int N,
    __global const float* bias, int act, __global const float* residual, __global float* out, int out_row0) {
  __local float as[BK][BM + 1], bs[BK][BN];
  const int item = get_local_id(0);
  const int tx = item % SIDE, ty = item / SIDE;
  const int m0 = get_group_id(1) * BM, n0 = get_group_id(0) * BN;
  const int C = c0 + c1, K = T * C;
  float acc[RM][RN];
  for (int i = 0; i < RM; ++i)
    for (int j = 0; j < RN; ++j) acc[i][j] = 0.0f;

  for (int kk = 0; kk < K; kk += BK) {
    {  // each work-item loads one column of A's piece, RM rows of it, so that a row's neighbours lie in neighbouring work-items
      const int k = kk + tx;
      const int t = k / C, c = k - t * C;
      const float sc = k < K && scale ? scale[c] : 1.0f, sh = k < K && scale ? shift[c] : 0.0f;
      for (int i = 0; i < RM; ++i) {
        const int m = m0 + ty + SIDE * i;
        float v = 0.0f;
        if (k < K && m < M) {
          const int row = map ? map[(size_t)(row0 + m) * T + t] : row0 + m;
          if (row >= 0 && row < src_rows) {
            v = c < c0 ? x0[(size_t)row * c0 + c] : x1[(size_t)row * c1 + (c - c0)];
            v = mad(v, sc, sh);
            if (silu_a) v = silu(v);
          }
        }
        as[tx][ty + SIDE * i] = v;
      }
    }
    for (int i = 0; i < RN; ++i) {
      const int at = item + SIDE * SIDE * i;
      const int k = kk + at / BN, n = n0 + at % BN;
      bs[at / BN][at % BN] = k < K && n < N ? b[(size_t)k * N + n] : 0.0f;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int k = 0; k < BK; ++k) {
      float av[RM], bv[RN];
      for (int i = 0; i < RM; ++i) av[i] = as[k][ty * RM + i];
      for (int j = 0; j < RN; ++j) bv[j] = bs[k][tx + SIDE * j];
      for (int i = 0; i < RM; ++i)
        for (int j = 0; j < RN; ++j) acc[i][j] = mad(av[i], bv[j], acc[i][j]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }

  for (int i = 0; i < RM; ++i) {
    const int m = m0 + ty * RM + i;
    for (int j = 0; j < RN; ++j) {
      const int n = n0 + tx + SIDE * j;
      if (m >= M || n >= N) continue;
      const size_t at = (size_t)(out_row0 + m) * N + n;
      const float v = activate(acc[i][j] + (bias ? bias[n] : 0.0f), act);
      out[at] = residual ? v + residual[at] : v;
    }
  }
}

// The epilogue alone, after a library's GEMM: out = act(x + bias) + residual, all from row row0 on but x, which starts at its first row.
// One work-item per element of [M, N]; x may be the same rows of out.
__kernel void gemm_epilogue(__global const float* x, int x_row0, int M, int N, __global const float* bias, int act,
                            __global const float* residual, __global float* out, int row0) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)M * N) return;
  const size_t at = (size_t)row0 * N + i;
  const float v = activate(x[(size_t)x_row0 * N + i] + (bias ? bias[i % N] : 0.0f), act);
  out[at] = residual ? v + residual[at] : v;
}
