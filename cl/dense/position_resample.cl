// The stored position embedding (a grid of g x g tokens) on the token grid of the input (t x t), along each axis by
// itself, and the class token's row.
// ```
// argument     type  shape     what
// stored       f32   [1+gg,C]  stored embedding, the class token's row first
// class_token  f32   [C]       class token
// first        i32   [t]       the first stored row (or column) that an output row (or column) draws on
// weight       f32   [t,n]     how much it draws on each of n from there on; 0 for those beyond the grid
// out          f32   [1+tt,C]  written: resampled; out[0] = stored[0] + class_token
// work-items   (channel, token)
// ```
#include "common.clh"

// Row `token` > 0 of what a grid of `from` x `from` tokens becomes on a grid of `to` x `to`.
static inline float resampled(global const float* grid, global const int* first, global const float* weight, int token,
                              int from, int to, int n, int C, int c) {
  const int y = (token - 1) / to, x = (token - 1) % to;
  float sum = 0.0f;
  for (int j = 0; j < n; ++j) {
    const int from_y = min(first[y] + j, from - 1);
    float line = 0.0f;
    for (int i = 0; i < n; ++i) {
      const int from_x = min(first[x] + i, from - 1);
      line += weight[x * n + i] * grid[(size_t)(1 + from_y * from + from_x) * C + c];
    }
    sum += weight[y * n + j] * line;
  }
  return sum;
}

kernel void position_resample_forward(global const float* stored, global const float* class_token,
                                      global const int* first, global const float* weight, global float* out, int g,
                                      int t, int n, int C) {
  const int c = get_global_id(0), token = get_global_id(1);
  if (c >= C || token > t * t) return;
  out[(size_t)token * C + c] =
      token == 0 ? stored[c] + class_token[c] : resampled(stored, first, weight, token, g, t, n, C, c);
}

// Backward: the same with the transposed tables, and with the grids exchanged.
// ```
// argument    type  shape     what
// dout        f32   [1+tt,C]  gradient of out
// first       i32   [g]       the first output row (or column) that draws on a stored row (or column)
// weight      f32   [g,n]     how much each of n from there on does
// dstored     f32   [1+gg,C]  added to
// dclass      f32   [C]       added to, by dout's first row
// work-items  (channel, token)
// ```
kernel void position_resample_backward(global const float* dout, global const int* first, global const float* weight,
                                       global float* dstored, global float* dclass, int g, int t, int n, int C) {
  const int c = get_global_id(0), token = get_global_id(1);
  if (c >= C || token > g * g) return;
  if (token == 0) {
    dstored[c] += dout[c];
    dclass[c] += dout[c];
  } else {
    dstored[(size_t)token * C + c] += resampled(dout, first, weight, token, t, g, n, C, c);
  }
}
