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
// define GROUP     256                 256, 128 or 64
// work-items       groups of GROUP: (tile of GROUP / 4 tokens, v H + h), the tokens being queries or keys
// ```
// A group goes through the other tokens (keys or queries) in blocks of 32. Weights go through local memory, 16.5 KB in
// all (12.5 KB in groups of 128, 10.5 KB in groups of 64).
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

kernel MANY_REGISTERS __attribute__((reqd_work_group_size(GROUP, 1, 1))) void attention_backward_by_query(
    global const float* qkv, global const float* stats, global const float* delta, global const float* dout,
    global float* dqkv, int V, int T, int H, int D, float scale) {
  local float4 stage[STAGE], ds[WEIGHTS];
  const int item = get_local_id(0), x = item % 16, y = item / 16, vh = GROUP_ID(1);
  const int v = vh / H, h = vh % H, t0 = GROUP_ID(0) * ROWS;
  const size_t step = (size_t)3 * H * D, out_step = (size_t)H * D;
  global const float* queries = qkv + (size_t)v * T * step + (size_t)h * D;
  global const float* keys = queries + out_step;
  global const float* values = keys + out_step;
  global const float* g = dout + (size_t)v * T * out_step + (size_t)h * D;
  // The statistics of its four rows.
  global const float* own = stats + 2 * ((size_t)vh * T + t0);
  const int left = T - t0 - 4 * y;
  const float2 s0 = left > 0 ? vload2(4 * y, own) : (float2)(0.0f),
               s1 = left > 1 ? vload2(4 * y + 1, own) : (float2)(0.0f),
               s2 = left > 2 ? vload2(4 * y + 2, own) : (float2)(0.0f),
               s3 = left > 3 ? vload2(4 * y + 3, own) : (float2)(0.0f);
  const float4 top = (float4)(s0.x, s1.x, s2.x, s3.x), inverse = (float4)(s0.y, s1.y, s2.y, s3.y);
  global const float* means = delta + (size_t)vh * T + t0 + 4 * y;
  const float4 mean = (float4)(left > 0 ? means[0] : 0.0f, left > 1 ? means[1] : 0.0f, left > 2 ? means[2] : 0.0f,
                               left > 3 ? means[3] : 0.0f);
  Rows4 acc[BLOCKS];
  clear_rows(acc);
  for (int k0 = 0; k0 < T; k0 += COLS) {
    const float8 s =
        products(queries + t0 * step, step, T - t0, scale * LOG2E, keys + k0 * step, step, T - k0, 1.0f, D, stage);
    const float8 dp =
        products(g + t0 * out_step, out_step, T - t0, 1.0f, values + k0 * step, step, T - k0, 1.0f, D, stage);
    // A key beyond T has score 0, which may be far above the other scores: its weight is bounded, then multiplied by 0.
    // A selection between vectors would end PoCL 6.0's compiler ("did not reach a fixpoint").
    const float near = k0 + x < T ? 1.0f : 0.0f, far = k0 + x + 16 < T ? 1.0f : 0.0f;
    ds[x * (ROW_STRIDE / 4) + y] = exp2(min(s.lo - top, 0.0f)) * inverse * (dp.lo - mean) * near;
    ds[(x + 16) * (ROW_STRIDE / 4) + y] = exp2(min(s.hi - top, 0.0f)) * inverse * (dp.hi - mean) * far;
    barrier(CLK_LOCAL_MEM_FENCE);
    add_up(ds, keys + k0 * step, step, T - k0, D, stage, acc);
  }
  store_rows(acc, (float4)(scale), T - t0, D, dqkv + ((size_t)(v * T + t0) * 3 * H + h) * D, step);
}

kernel MANY_REGISTERS __attribute__((reqd_work_group_size(GROUP, 1, 1))) void attention_backward_by_key(
    global const float* qkv, global const float* stats, global const float* delta, global const float* dout,
    global float* dqkv, int V, int T, int H, int D, float scale) {
  local float4 stage[STAGE], p[WEIGHTS];
  const int item = get_local_id(0), x = item % 16, y = item / 16, vh = GROUP_ID(1);
  const int v = vh / H, h = vh % H, t0 = GROUP_ID(0) * ROWS;
  const size_t step = (size_t)3 * H * D, out_step = (size_t)H * D;
  global const float* queries = qkv + (size_t)v * T * step + (size_t)h * D;
  global const float* keys = queries + out_step;
  global const float* values = keys + out_step;
  global const float* g = dout + (size_t)v * T * out_step + (size_t)h * D;
  Rows4 by_key[BLOCKS], by_value[BLOCKS];
  clear_rows(by_key);
  clear_rows(by_value);
  for (int q0 = 0; q0 < T; q0 += COLS) {
    const int near = q0 + x, far = near + 16, at = x * (ROW_STRIDE / 4) + y, beyond = 16 * (ROW_STRIDE / 4);
    const size_t row = (size_t)vh * T;
    {  // its weights are in local memory for the next step
      const float8 s =
          products(keys + t0 * step, step, T - t0, 1.0f, queries + q0 * step, step, T - q0, scale * LOG2E, D, stage);
      const float2 row0 = near < T ? vload2(row + near, stats) : (float2)(0.0f),
                   row1 = far < T ? vload2(row + far, stats) : (float2)(0.0f);
      p[at] = exp2(s.lo - row0.x) * row0.y;
      p[at + beyond] = exp2(s.hi - row1.x) * row1.y;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    add_up(p, g + q0 * out_step, out_step, T - q0, D, stage, by_value);
    const float8 dp =
        products(values + t0 * step, step, T - t0, 1.0f, g + q0 * out_step, out_step, T - q0, 1.0f, D, stage);
    // From here on p holds derivatives: each work-item computes those of its own weights.
    p[at] *= dp.lo - (near < T ? delta[row + near] : 0.0f);
    p[at + beyond] *= dp.hi - (far < T ? delta[row + far] : 0.0f);
    barrier(CLK_LOCAL_MEM_FENCE);
    add_up(p, queries + q0 * step, step, T - q0, D, stage, by_key);
  }
  global float* to = dqkv + (((size_t)(v * T + t0) * 3 + 1) * H + h) * D;
  store_rows(by_key, (float4)(scale), T - t0, D, to, step);
  store_rows(by_value, (float4)(1.0f), T - t0, D, to + out_step, step);
}
