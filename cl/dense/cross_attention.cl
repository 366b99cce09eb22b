// Attention in many small independent groups: the queries of group g attend only to the keys of group g,
//   out[q] = sum_s p_s v_s,   p = softmax over the group's keys of q . k_s / sqrt(D),
// head by head. It serves LaRa's windows (the voxels of a cell attend to the features lifted to it), its fine decoder
// (a primitive attends to the views' features at its place), and the windows of the ray predictor. There a key is in
// groups of several views, and windows join tokens of a picture's opposite sides: their scores are lowered by 100.
// ```
// argument    type   shape    what
// q           f32    [Q,H,D]  queries; each is in one group
// k           f32    [N,H,D]  keys
// v           f32    [N,H,D]  values, of the keys
// queries     i32    [G,L]    each group's rows of q; null: the g-th L of them
// keys        i32    [G,S]    each group's rows of k and v; null: the g-th S of them
// query_parts i32    [G,L]    part of the picture of each query, and
// key_parts   i32    [G,S]    of each key; 100 is subtracted between parts; null: no mask
// out         f32    [Q,H,D]  written
// stats       f32    [Q,H]    written: the logarithm of the sum of exponentials; null: not written
// scale       float           1 / sqrt(D)
// define HEAD_PAD  16         D rounded up to 16
// work-items  one per (query of a group, head), heads fastest
// ```
// A head is a few vectors of 16 in registers, and neighbouring work-items read neighbouring heads: one kernel for all
// devices. No array of size L x S is stored.
#include "many_registers.clh"
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

// The mask that is added to the score of a query and a key, by their places in the groups.
static inline float stranger(global const int* query_parts, int query, global const int* key_parts, int key) {
  return query_parts && query_parts[query] != key_parts[key] ? -100.0f : 0.0f;
}

kernel MANY_REGISTERS void cross_attention_forward(global const float* restrict q, global const float* restrict k,
                                                   global const float* restrict v, global const int* restrict queries,
                                                   global const int* restrict keys,
                                                   global const int* restrict query_parts,
                                                   global const int* restrict key_parts, global float* restrict out,
                                                   global float* restrict stats, int G, int L, int S, int H, int D,
                                                   float scale) {
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
    const float score = dot_head(query, x) + stranger(query_parts, at, key_parts, g * S + s);
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
kernel MANY_REGISTERS void cross_attention_backward_by_query(
    global const float* restrict q, global const float* restrict k, global const float* restrict v,
    global const int* restrict queries, global const int* restrict keys, global const int* restrict query_parts,
    global const int* restrict key_parts, global const float* restrict out, global const float* restrict stats,
    global const float* restrict dout, global float* restrict dq, global float* restrict delta, int G, int L, int S,
    int H, int D, float scale) {
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
    const float score = dot_head(query, x) + stranger(query_parts, at, key_parts, g * S + s);
    const float by_score = exp(score - normaliser) * (dp - own) * scale;
    for (int i = 0; i < VECTORS; ++i) sum[i] += by_score * x[i];
  }
  store_head(sum, dq + row * D, D);
  delta[row] = own;
}

// ```
// argument    type  shape    what
// places      i32   [N,B]    the B places of each key among the G S of the groups; null: each key has one
// delta       f32   [Q,H]    from cross_attention_backward_by_query
// dk          f32   [N,H,D]  written
// dv          f32   [N,H,D]  written
// work-items  one per (key, head), heads fastest; without `places`, in the order of the groups
// ```
kernel MANY_REGISTERS void cross_attention_backward_by_key(
    global const float* restrict q, global const float* restrict k, global const float* restrict v,
    global const int* restrict queries, global const int* restrict keys, global const int* restrict query_parts,
    global const int* restrict key_parts, global const int* restrict places, global const float* restrict stats,
    global const float* restrict delta, global const float* restrict dout, global float* restrict dk,
    global float* restrict dv, int G, int L, int S, int H, int D, int B, float scale) {
  const int id = get_global_id(0);
  if (id >= G * S / B * H) return;
  const int h = id % H, at = id / H;
  const size_t key = ((size_t)(keys && !places ? keys[at] : at) * H + h) * D;
  float16 own_k[VECTORS], own_v[VECTORS], by_k[VECTORS], by_v[VECTORS], x[VECTORS];
  load_head(own_k, k + key, D);
  load_head(own_v, v + key, D);
  for (int i = 0; i < VECTORS; ++i) own_k[i] *= scale, by_k[i] = by_v[i] = (float16)(0.0f);
  for (int b = 0; b < B; ++b) {
    const int place = places ? places[at * B + b] : at, first = place / S * L;
    for (int l = first; l < first + L; ++l) {
      const size_t row = (size_t)(queries ? queries[l] : l) * H + h;
      load_head(x, q + row * D, D);
      const float p = exp(dot_head(own_k, x) + stranger(query_parts, l, key_parts, place) - stats[row]);
      load_head(x, dout + row * D, D);
      const float by_score = p * (dot_head(own_v, x) - delta[row]) * scale;
      for (int i = 0; i < VECTORS; ++i) by_v[i] += p * x[i];
      // Loads q again, with an address that depends on the score: registers could not hold it beside dout.
      load_head(x, q + (by_score == by_score ? row * D : 0), D);
      for (int i = 0; i < VECTORS; ++i) by_k[i] += by_score * x[i];
    }
  }
  store_head(by_k, dk + key, D);
  store_head(by_v, dv + key, D);
}
