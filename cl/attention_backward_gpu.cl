// Gradients of multi-head self-attention without a T x T matrix, gpu flavour: the mathematics of
// attention_backward_cpu.cl.
// ```
// argument         type   shape        what
// qkv              f32    [V,T,3,H,D]  as the forward took it; any sizes >= 1
// stats            f32    [V,H,T,2]    as the forward wrote it
// out              f32    [V,T,H D]    as the forward wrote it
// dout             f32    [V,T,H D]    gradient of out
// delta            f32    [V,H,T]      written by attention_backward_delta: dout . out
// dqkv             f32    [V,T,3,H,D]  written: dq by attention_backward_by_query, dk and dv by
//                                      attention_backward_by_key
// scale            float               1 / sqrt(D)
// define HEAD_PAD  64                  D rounded up to a multiple of 64
// work-items       groups of 256: (tile of 64 tokens, v H + h), the tokens being queries or keys
// ```
// A group goes through the other tokens (keys or queries) in blocks of 32. Weights go through local memory, 25 KB in
// all.
#include "attention_tile_gpu.clh"

// Work-items (token, v H + h).
kernel void attention_backward_delta(global const float* out, global const float* dout, global float* delta, int V,
                                     int T, int H, int D) {
  const int t = get_global_id(0), vh = get_global_id(1);
  if (t >= T) return;
  const size_t at = (((size_t)(vh / H) * T + t) * H + vh % H) * D;
  float sum = 0.0f;
  for (int d = 0; d < D; ++d) sum += out[at + d] * dout[at + d];
  delta[(size_t)vh * T + t] = sum;
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void attention_backward_by_query(
    global const float* qkv, global const float* stats, global const float* delta, global const float* dout,
    global float* dqkv, int V, int T, int H, int D, float scale) {
  local float stage[COLS * 64], ds[ROWS * (COLS + 1)];
  const int item = get_local_id(0), x = item % 16, y = item / 16, vh = get_group_id(1);
  const int v = vh / H, h = vh % H, t0 = get_group_id(0) * ROWS;
  const size_t step = (size_t)3 * H * D, out_step = (size_t)H * D;
  global const float* queries = qkv + (size_t)v * T * step + (size_t)h * D;
  global const float* keys = queries + out_step;
  global const float* values = keys + out_step;
  global const float* g = dout + (size_t)v * T * out_step + (size_t)h * D;
  float acc[4][MINE], top[4], inverse[4], mean[4];
  for (int i = 0; i < 4; ++i) {
    const int t = t0 + 4 * y + i;
    const float2 row = t < T ? vload2((size_t)vh * T + t, stats) : (float2)(0.0f, 0.0f);
    top[i] = row.x;
    inverse[i] = row.y;
    mean[i] = t < T ? delta[(size_t)vh * T + t] : 0.0f;
    for (int c = 0; c < MINE; ++c) acc[i][c] = 0.0f;
  }
  for (int k0 = 0; k0 < T; k0 += COLS) {
    float s[4][2], dp[4][2];
    products(queries + t0 * step, step, T - t0, scale * LOG2E, keys + k0 * step, step, T - k0, 1.0f, D, stage, s);
    products(g + t0 * out_step, out_step, T - t0, 1.0f, values + k0 * step, step, T - k0, 1.0f, D, stage, dp);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 2; ++j)
        ds[(4 * y + i) * (COLS + 1) + x + 16 * j] =
            k0 + x + 16 * j < T ? exp2(s[i][j] - top[i]) * inverse[i] * (dp[i][j] - mean[i]) : 0.0f;
    barrier(CLK_LOCAL_MEM_FENCE);
    add_up(ds, keys + k0 * step, step, T - k0, D, stage, acc);
  }
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < MINE; ++c) {
      const int t = t0 + 4 * y + i, d = x + 16 * c;
      if (t < T && d < D) dqkv[((size_t)(v * T + t) * 3 * H + h) * D + d] = acc[i][c] * scale;
    }
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void attention_backward_by_key(
    global const float* qkv, global const float* stats, global const float* delta, global const float* dout,
    global float* dqkv, int V, int T, int H, int D, float scale) {
  local float stage[COLS * 64], p[ROWS * (COLS + 1)], ds[ROWS * (COLS + 1)];
  const int item = get_local_id(0), x = item % 16, y = item / 16, vh = get_group_id(1);
  const int v = vh / H, h = vh % H, t0 = get_group_id(0) * ROWS;
  const size_t step = (size_t)3 * H * D, out_step = (size_t)H * D;
  global const float* queries = qkv + (size_t)v * T * step + (size_t)h * D;
  global const float* keys = queries + out_step;
  global const float* values = keys + out_step;
  global const float* g = dout + (size_t)v * T * out_step + (size_t)h * D;
  float by_key[4][MINE], by_value[4][MINE];
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < MINE; ++c) by_key[i][c] = by_value[i][c] = 0.0f;
  for (int q0 = 0; q0 < T; q0 += COLS) {
    float s[4][2], dp[4][2];
    products(keys + t0 * step, step, T - t0, 1.0f, queries + q0 * step, step, T - q0, scale * LOG2E, D, stage, s);
    products(values + t0 * step, step, T - t0, 1.0f, g + q0 * out_step, out_step, T - q0, 1.0f, D, stage, dp);
    for (int j = 0; j < 2; ++j) {
      const int t = q0 + x + 16 * j;
      const float2 row = t < T ? vload2((size_t)vh * T + t, stats) : (float2)(0.0f, 0.0f);
      const float mean = t < T ? delta[(size_t)vh * T + t] : 0.0f;
      for (int i = 0; i < 4; ++i) {
        const int at = (4 * y + i) * (COLS + 1) + x + 16 * j;
        const float weight = exp2(s[i][j] - row.x) * row.y;
        p[at] = weight;
        ds[at] = weight * (dp[i][j] - mean);
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    add_up(ds, queries + q0 * step, step, T - q0, D, stage, by_key);
    add_up(p, g + q0 * out_step, out_step, T - q0, D, stage, by_value);
  }
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < MINE; ++c) {
      const int t = t0 + 4 * y + i, d = x + 16 * c;
      if (t >= T || d >= D) continue;
      const size_t at = ((size_t)((v * T + t) * 3 + 1) * H + h) * D + d;
      dqkv[at] = by_key[i][c] * scale;
      dqkv[at + out_step] = by_value[i][c];
    }
}
