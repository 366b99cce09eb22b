// Attention in many small groups that know nothing of each other: the queries of group g look at the keys of group g
// alone,
//   out[q] = sum_s p_s v_s,   p = softmax over the group's keys of q . k_s / sqrt(D),
// head by head. LaRa's windows (the voxels of a cell at what was lifted to it) and its fine decoder (a primitive at
// what the views show at its place).
// ```
// argument    type   shape    what
// q           f32    [Q,H,D]  queries; each is in one group
// k           f32    [N,H,D]  keys; each is in one group
// v           f32    [N,H,D]  values, of the keys
// queries     i32    [G,L]    each group's rows of q; null: the g-th L of them
// keys        i32    [G,S]    each group's rows of k and v; null: the g-th S of them
// out         f32    [Q,H,D]  written
// stats       f32    [Q,H]    written: the logarithm of the sum of exponentials; null: not wanted
// scale       float           1 / sqrt(D)
// define HEAD_PAD  16         D rounded up to 16
// work-items  one per (query of a group, head), heads fastest
// ```
// A head is a few vectors of 16 in registers, and neighbouring work-items read neighbouring heads: the same on all
// devices. Nothing is stored of a size L x S.
#include "vector16.clh"

#ifndef HEAD_PAD
#define HEAD_PAD 16
#endif
#define VECTORS (HEAD_PAD / 16)

static inline void load_head(float16* to, global const float* x, int D) {
  for (int i = 0; i < VECTORS; ++i) to[i] = load_part(x + 16 * i, D - 16 * i);
}
static inline void store_head(float16* from, global float* x, int D) {
  for (int i = 0; i < VECTORS; ++i)
    if (D > 16 * i) store_part(from[i], D - 16 * i, x + 16 * i);
}
static inline float dot_head(float16* a, float16* b) {
  float16 sum = a[0] * b[0];
  for (int i = 1; i < VECTORS; ++i) sum += a[i] * b[i];
  return sum_of(sum);
}

kernel void cross_attention_forward(global const float* restrict q, global const float* restrict k,
                                    global const float* restrict v, global const int* restrict queries,
                                    global const int* restrict keys, global float* restrict out,
                                    global float* restrict stats, int G, int L, int S, int H, int D, float scale) {
  const int id = get_global_id(0);
  if (id >= G * L * H) return;
  const int h = id % H, at = id / H, g = at / L;
  const size_t row = (size_t)(queries ? queries[at] : at) * H + h;
  float16 query[VECTORS], sum[VECTORS], x[VECTORS];
  load_head(query, q + row * D, D);
  for (int i = 0; i < VECTORS; ++i) query[i] *= scale, sum[i] = (float16)(0.0f);
  float largest = -INFINITY, total = 0.0f;
  for (int s = 0; s < S; ++s) {
    const size_t key = ((size_t)(keys ? keys[g * S + s] : g * S + s) * H + h) * D;
    load_head(x, k + key, D);
    const float score = dot_head(query, x);
    if (score > largest) {
      const float less = exp(largest - score);
      total *= less;
      for (int i = 0; i < VECTORS; ++i) sum[i] *= less;
      largest = score;
    }
    const float p = exp(score - largest);
    total += p;
    load_head(x, v + key, D);
    for (int i = 0; i < VECTORS; ++i) sum[i] += p * x[i];
  }
  for (int i = 0; i < VECTORS; ++i) sum[i] /= total;
  store_head(sum, out + row * D, D);
  if (stats) stats[row] = largest + log(total);
}

// Backward: with dp_s = dout . v_s and delta = dout . out,
//   dv_s = sum_q p_s dout,
//   dq = sum_s p_s (dp_s - delta) k_s / sqrt(D),
//   dk_s = sum_q p_s (dp_s - delta) q / sqrt(D).
// ```
// argument    type  shape    what
// out, stats                 as the forward left them
// dout        f32   [Q,H,D]  gradient of out
// dq          f32   [Q,H,D]  written
// delta       f32   [Q,H]    written, for cross_attention_backward_by_key
// work-items  as in the forward
// ```
kernel void cross_attention_backward_by_query(global const float* restrict q, global const float* restrict k,
                                              global const float* restrict v, global const int* restrict queries,
                                              global const int* restrict keys, global const float* restrict out,
                                              global const float* restrict stats, global const float* restrict dout,
                                              global float* restrict dq, global float* restrict delta, int G, int L,
                                              int S, int H, int D, float scale) {
  const int id = get_global_id(0);
  if (id >= G * L * H) return;
  const int h = id % H, at = id / H, g = at / L;
  const size_t row = (size_t)(queries ? queries[at] : at) * H + h;
  float16 query[VECTORS], d[VECTORS], sum[VECTORS], x[VECTORS];
  load_head(query, q + row * D, D);
  load_head(d, dout + row * D, D);
  load_head(x, out + row * D, D);
  const float own = dot_head(d, x), normaliser = stats[row];
  for (int i = 0; i < VECTORS; ++i) query[i] *= scale, sum[i] = (float16)(0.0f);
  for (int s = 0; s < S; ++s) {
    const size_t key = ((size_t)(keys ? keys[g * S + s] : g * S + s) * H + h) * D;
    load_head(x, v + key, D);
    const float dp = dot_head(d, x);
    load_head(x, k + key, D);
    const float by_score = exp(dot_head(query, x) - normaliser) * (dp - own) * scale;
    for (int i = 0; i < VECTORS; ++i) sum[i] += by_score * x[i];
  }
  store_head(sum, dq + row * D, D);
  delta[row] = own;
}

// ```
// argument    type  shape    what
// delta       f32   [Q,H]    from cross_attention_backward_by_query
// dk          f32   [N,H,D]  written
// dv          f32   [N,H,D]  written
// work-items  one per (key of a group, head), heads fastest
// ```
kernel void cross_attention_backward_by_key(global const float* restrict q, global const float* restrict k,
                                            global const float* restrict v, global const int* restrict queries,
                                            global const int* restrict keys, global const float* restrict stats,
                                            global const float* restrict delta, global const float* restrict dout,
                                            global float* restrict dk, global float* restrict dv, int G, int L, int S,
                                            int H, int D, float scale) {
  const int id = get_global_id(0);
  if (id >= G * S * H) return;
  const int h = id % H, at = id / H, g = at / S;
  const size_t key = ((size_t)(keys ? keys[at] : at) * H + h) * D;
  float16 own_k[VECTORS], own_v[VECTORS], by_k[VECTORS], by_v[VECTORS], x[VECTORS], d[VECTORS];
  load_head(own_k, k + key, D);
  load_head(own_v, v + key, D);
  for (int i = 0; i < VECTORS; ++i) own_k[i] *= scale, by_k[i] = by_v[i] = (float16)(0.0f);
  for (int l = 0; l < L; ++l) {
    const size_t row = (size_t)(queries ? queries[g * L + l] : g * L + l) * H + h;
    load_head(x, q + row * D, D);
    load_head(d, dout + row * D, D);
    const float p = exp(dot_head(own_k, x) - stats[row]);
    const float by_score = p * (dot_head(own_v, d) - delta[row]) * scale;
    for (int i = 0; i < VECTORS; ++i) by_v[i] += p * d[i], by_k[i] += by_score * x[i];
  }
  store_head(by_k, dk + key, D);
  store_head(by_v, dv + key, D);
}
