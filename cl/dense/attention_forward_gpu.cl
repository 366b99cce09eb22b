// Multi-head self-attention without a T x T matrix, gpu flavour: out = softmax(Q K^T / sqrt(D)) V, by blocks of keys,
// with a running softmax (its sum and its largest score so far). ``` argument type shape what qkv f32 [V,T,3,H,D]
// queries, keys and values of T tokens in V views, H heads of D channels; any sizes >= 1 out f32 [V,T,H D] written
// stats f32 [V,H,T,2] written for the backward: each query's largest score, in units of ln 2, and one over the sum of
// 2^(score - largest); null: not written scale float 1 / sqrt(D) define HEAD_PAD 64 D rounded up to a multiple of 64
// define GROUP 256 256, 128 or 64 work-items groups of GROUP: (tile of GROUP / 4 queries, v H + h) ``` A group goes
// through the keys in blocks of 32. Weights go through local memory, 17.5 KB in all (13 KB in groups of 128, 10.8 KB in
// groups of 64); the softmax of a query is shared by 4 work-items, which take a quarter of the block's keys each.
#include "attention_tile_gpu.clh"

// The running softmax of query item % ROWS, for which this work-item handles one quarter of the keys of each block. The
// four work-items of a query have the same state.
typedef struct {
  float largest, total;  // score so far, and the sum of 2^(score - largest)
} Softmax;

// Turns a block's scores w [COLS, ROW_STRIDE] into weights, in place. part: local memory [4 * ROWS]; on return its
// first ROWS numbers are the factors for each query's earlier sums. Begins and ends with a barrier.
INLINE void softmax_step(local float* w, local float* part, Softmax* state) {
  const int item = get_local_id(0), mine = item % ROWS, quarter = item / ROWS;
  local float* own = w + quarter * (COLS / 4) * ROW_STRIDE + mine;
  barrier(CLK_LOCAL_MEM_FENCE);
  float top = -INFINITY;
  for (int j = 0; j < COLS / 4; ++j) top = max(top, own[j * ROW_STRIDE]);
  part[quarter * ROWS + mine] = top;
  barrier(CLK_LOCAL_MEM_FENCE);
  top = max(state->largest, max(max(part[mine], part[ROWS + mine]), max(part[2 * ROWS + mine], part[3 * ROWS + mine])));
  barrier(CLK_LOCAL_MEM_FENCE);
  float sum = 0.0f;
  for (int j = 0; j < COLS / 4; ++j) {
    const float weight = exp2(own[j * ROW_STRIDE] - top);
    own[j * ROW_STRIDE] = weight;
    sum += weight;
  }
  part[quarter * ROWS + mine] = sum;
  const float decay = state->largest == top ? 1.0f : exp2(state->largest - top);
  barrier(CLK_LOCAL_MEM_FENCE);
  state->total =
      state->total * decay + ((part[mine] + part[ROWS + mine]) + (part[2 * ROWS + mine] + part[3 * ROWS + mine]));
  state->largest = top;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (quarter == 0) part[mine] = decay;
  barrier(CLK_LOCAL_MEM_FENCE);
}

kernel MANY_REGISTERS __attribute__((reqd_work_group_size(GROUP, 1, 1))) void attention_forward_gpu(
    global const float* qkv, global float* out, global float* stats, int V, int T, int H, int D, float scale) {
  local float4 stage[STAGE], w[WEIGHTS], part[ROWS];
  local float* parts = (local float*)part;
  const int item = get_local_id(0), x = item % 16, y = item / 16, vh = GROUP_ID(1);
  const int v = vh / H, h = vh % H, t0 = GROUP_ID(0) * ROWS;
  const size_t step = (size_t)3 * H * D;
  global const float* queries = qkv + (size_t)v * T * step + (size_t)h * D;
  global const float* keys = queries + (size_t)H * D;
  global const float* values = keys + (size_t)H * D;
  Rows4 acc[BLOCKS];
  clear_rows(acc);
  Softmax state = {-INFINITY, 0.0f};
  for (int k0 = 0; k0 < T; k0 += COLS) {
    const float8 s =
        products(queries + t0 * step, step, T - t0, scale * LOG2E, keys + k0 * step, step, T - k0, 1.0f, D, stage);
    w[x * (ROW_STRIDE / 4) + y] = k0 + x < T ? s.lo : (float4)(-INFINITY);
    w[(x + 16) * (ROW_STRIDE / 4) + y] = k0 + x + 16 < T ? s.hi : (float4)(-INFINITY);
    softmax_step((local float*)w, parts, &state);
    const float4 by = part[y];
#pragma unroll
    for (int c = 0; c < BLOCKS; ++c) acc[c].r0 *= by.x, acc[c].r1 *= by.y, acc[c].r2 *= by.z, acc[c].r3 *= by.w;
    add_up(w, values + k0 * step, step, T - k0, D, stage, acc);
  }
  if (item < ROWS) {
    parts[item] = state.total;
    if (stats && t0 + item < T) vstore2((float2)(state.largest, 1.0f / state.total), (size_t)vh * T + t0 + item, stats);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  store_rows(acc, 1.0f / part[y], T - t0, D, out + ((size_t)(v * T + t0) * H + h) * D, (size_t)H * D);
}
