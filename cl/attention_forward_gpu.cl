// Multi-head self-attention without a T x T matrix, gpu flavour: out = softmax(Q K^T / sqrt(D)) V, by blocks of keys,
// with the softmax carried along from block to block (its sum and its largest score so far).
// ```
// argument         type   shape        what
// qkv              f32    [V,T,3,H,D]  queries, keys and values of T tokens in V views, H heads of D channels; any
//                                      sizes >= 1
// out              f32    [V,T,H D]    written
// stats            f32    [V,H,T,2]    written for the backward: each query's largest score, in units of ln 2, and one
//                                      over the sum of 2^(score - largest); null: not wanted
// scale            float               1 / sqrt(D)
// define HEAD_PAD  64                  D rounded up to a multiple of 64
// work-items       groups of 256: (tile of 64 queries, v H + h)
// ```
// A group goes through the keys in blocks of 32. Of the scores, a work-item has queries 4y .. 4y+3 and keys x, x + 16.
// Weights go through local memory (24.5 KB in all); the softmax of a query is shared by 4 work-items, which take a
// quarter of the block's keys each. Of the output, a work-item has queries 4y .. 4y+3 and channels x + 16 i, in
// registers.
#include "common.clh"

#ifndef HEAD_PAD
#define HEAD_PAD 64
#endif
#define ROWS 64
#define KEYS 32
#define DEPTH 16  // channels staged at a time for the scores
#define GROUP 256
#define MINE (HEAD_PAD / 16)
#define LOG2E 1.44269504088896341f

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void attention_forward_gpu(global const float* qkv,
                                                                                     global float* out,
                                                                                     global float* stats, int V, int T,
                                                                                     int H, int D, float scale) {
  local float qs[DEPTH][ROWS + 1], ks[DEPTH][KEYS + 1], ws[ROWS][KEYS + 1], vs[KEYS][64], part[4][ROWS];
  const int item = get_local_id(0), x = item % 16, y = item / 16, vh = get_group_id(1);
  const int v = vh / H, h = vh % H, t0 = get_group_id(0) * ROWS;
  const size_t row = (size_t)3 * H * D;
  global const float* queries = qkv + (size_t)v * T * row + (size_t)h * D;
  global const float* keys = queries + (size_t)H * D;
  global const float* values = keys + (size_t)H * D;
  float acc[4][MINE];
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < MINE; ++c) acc[i][c] = 0.0f;
  // In the softmax this work-item has query item % 64, of which it takes 8 keys of the block, from 8 (item / 64) on.
  // The four work-items of a query keep the same state.
  const int mine = item % ROWS, quarter = item / ROWS;
  float largest = -INFINITY, total = 0.0f;
  for (int k0 = 0; k0 < T; k0 += KEYS) {
    float s[4][2] = {{0.0f, 0.0f}, {0.0f, 0.0f}, {0.0f, 0.0f}, {0.0f, 0.0f}};
    for (int d0 = 0; d0 < D; d0 += DEPTH) {
      for (int e = item; e < ROWS * DEPTH; e += GROUP) {
        const int r = e / DEPTH, d = e % DEPTH;
        qs[d][r] = t0 + r < T && d0 + d < D ? queries[(size_t)(t0 + r) * row + d0 + d] * (scale * LOG2E) : 0.0f;
      }
      for (int e = item; e < KEYS * DEPTH; e += GROUP) {
        const int r = e / DEPTH, d = e % DEPTH;
        ks[d][r] = k0 + r < T && d0 + d < D ? keys[(size_t)(k0 + r) * row + d0 + d] : 0.0f;
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      for (int d = 0; d < DEPTH; ++d) {
        const float a = ks[d][x], b = ks[d][x + 16];
        for (int i = 0; i < 4; ++i) {
          const float q = qs[d][4 * y + i];
          s[i][0] = FMA(q, a, s[i][0]);
          s[i][1] = FMA(q, b, s[i][1]);
        }
      }
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    for (int i = 0; i < 4; ++i) {
      ws[4 * y + i][x] = k0 + x < T ? s[i][0] : -INFINITY;
      ws[4 * y + i][x + 16] = k0 + x + 16 < T ? s[i][1] : -INFINITY;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    float top = -INFINITY;
    for (int j = 0; j < KEYS / 4; ++j) top = max(top, ws[mine][quarter * (KEYS / 4) + j]);
    part[quarter][mine] = top;
    barrier(CLK_LOCAL_MEM_FENCE);
    top = max(largest, max(max(part[0][mine], part[1][mine]), max(part[2][mine], part[3][mine])));
    barrier(CLK_LOCAL_MEM_FENCE);
    float sum = 0.0f;
    for (int j = 0; j < KEYS / 4; ++j) {
      const float w = exp2(ws[mine][quarter * (KEYS / 4) + j] - top);
      ws[mine][quarter * (KEYS / 4) + j] = w;
      sum += w;
    }
    part[quarter][mine] = sum;
    const float decay = largest == top ? 1.0f : exp2(largest - top);
    barrier(CLK_LOCAL_MEM_FENCE);
    total = total * decay + ((part[0][mine] + part[1][mine]) + (part[2][mine] + part[3][mine]));
    largest = top;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (quarter == 0) part[0][mine] = decay;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int i = 0; i < 4; ++i) {
      const float by = part[0][4 * y + i];
      for (int c = 0; c < MINE; ++c) acc[i][c] *= by;
    }
    for (int c0 = 0; c0 < HEAD_PAD; c0 += 64) {
      for (int e = item; e < KEYS * 64; e += GROUP) {
        const int r = e / 64, d = c0 + e % 64;
        vs[r][e % 64] = k0 + r < T && d < D ? values[(size_t)(k0 + r) * row + d] : 0.0f;
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      for (int j = 0; j < KEYS; ++j)
        for (int i = 0; i < 4; ++i) {
          const float w = ws[4 * y + i][j];
          for (int c = 0; c < 4; ++c) acc[i][c0 / 16 + c] = FMA(w, vs[j][x + 16 * c], acc[i][c0 / 16 + c]);
        }
      barrier(CLK_LOCAL_MEM_FENCE);
    }
  }
  if (quarter == 0) part[0][mine] = total;
  if (stats && quarter == 0 && t0 + mine < T)
    vstore2((float2)(largest, 1.0f / total), (size_t)vh * T + t0 + mine, stats);
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = 0; i < 4; ++i) {
    const int t = t0 + 4 * y + i;
    const float inverse = 1.0f / part[0][4 * y + i];
    for (int c = 0; c < MINE; ++c) {
      const int d = x + 16 * c;
      if (t < T && d < D) out[((size_t)(v * T + t) * H + h) * D + d] = acc[i][c] * inverse;
    }
  }
}
