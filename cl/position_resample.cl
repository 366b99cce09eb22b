// The stored position embedding (g x g tokens) on the token grid (t x t), separably, and the class token's row.
//   stored [1 + g g, C], class_token [C], out [1 + t t, C]
//   first  i32 [t]     the first stored row (or column) that an output row (or column) draws on
//   weight [t, n]      how much of each of n from there on; those beyond g have weight 0
// out[0] = stored[0] + class_token. One work-item per (channel, token).
#include "common.clh"

__kernel void position_resample(__global const float* stored, __global const float* class_token,
                                __global const int* first, __global const float* weight, __global float* out, int g,
                                int t, int n, int C) {
  const int c = get_global_id(0), token = get_global_id(1);
  if (c >= C || token > t * t) return;
  if (token == 0) {
    out[c] = stored[c] + class_token[c];
    return;
  }
  const int y = (token - 1) / t, x = (token - 1) % t;
  float sum = 0.0f;
  for (int j = 0; j < n; ++j) {
    const int from_y = min(first[y] + j, g - 1);
    float line = 0.0f;
    for (int i = 0; i < n; ++i) {
      const int from_x = min(first[x] + i, g - 1);
      line += weight[x * n + i] * stored[(size_t)(1 + from_y * g + from_x) * C + c];
    }
    sum += weight[y * n + j] * line;
  }
  out[(size_t)token * C + c] = sum;
}
