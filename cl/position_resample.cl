// The stored position embedding (g x g tokens) on the token grid (t x t), separably, and the class token's row.
//   stored [1 + g g, C], class_token [C], out [1 + t t, C]
//   first  i32 [t]     the first stored row (or column) that an output row (or column) draws on
//   weight [t, n]      how much of each of n from there on; those beyond g have weight 0
// out[0] = stored[0] + class_token. Backward: the same with the transposed tables, from dout to dstored, which is added to; what
// reaches out's first row reaches both dstored's and dclass. One work-item per (channel, token).
#include "common.clh"

// Row `token` > 0 of what a grid of `from` x `from` tokens becomes on one of to x to.
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

// first [g], weight [g, n]: the output rows (or columns) that draw on a stored one, and how much each does.
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
