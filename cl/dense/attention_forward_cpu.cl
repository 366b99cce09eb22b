// Multi-head self-attention without a T x T matrix, cpu flavour: out = softmax(Q K^T / sqrt(D)) V, by blocks of keys,
// with a running softmax (its sum and its largest score so far). attention_forward_pack
// lays out keys and values first. The register tiles are explicit float16, and neighbouring groups share a head's keys
// in cache.
// ```
// argument         type   shape                what
// qkv              f32    [V,T,3,H,D]          queries, keys and values of T tokens in V views, H heads of D channels;
//                                              any sizes >= 1
// kt               f32    [V H,N,D,32]         written by attention_forward_pack: keys by panels of 32, transposed; N =
//                                              ceil(T/32); zero beyond T
// vp               f32    [V H,32 N,HEAD_PAD]  written by attention_forward_pack: values; zero beyond T and beyond
//                                              channel D
// out              f32    [V,T,H D]            written
// stats            f32    [V,H,T,2]            written for the backward: each query's largest score, in units of ln 2,
//                                              and one over the sum of 2^(score - largest); null: not written
// scale            float                       1 / sqrt(D)
// define HEAD_PAD  64                          D rounded up to a multiple of 32
// define PAIRS                                 mixed precision: kt is u32 [V H,N,ceil(D/2),32], pairs of neighbouring
//                                              channels, and vp u32 [V H,16 N,HEAD_PAD], of neighbouring keys
//                                              (pairs_cpu.clh); queries and weights are rounded, too, sums of weights
//                                              are of those that were not rounded
// work-items       groups of one; attention_forward_pack: (panel, v H + h); then (ROWS queries, v H + h)
// ```
#include "attention_tile_cpu.clh"
#include "vector16.clh"

static inline float max_of(float16 v) {
  const float8 a = max(v.lo, v.hi);
  const float4 b = max(a.lo, a.hi);
  const float2 c = max(b.lo, b.hi);
  return max(c.x, c.y);
}

kernel void attention_forward_pack(global const float* qkv, global Term* kt, global Term* vp, int V, int T, int H,
                                   int D) {
  const int n = get_global_id(0), vh = get_global_id(1);
  const int panels = DIV_UP(T, KEYS);
  if (n >= panels || vh >= V * H) return;
  const int v = vh / H, h = vh % H;
  const size_t row = (size_t)3 * H * D;
  global const float* k = qkv + (size_t)v * T * row + (size_t)(H + h) * D;
  global const float* values = k + (size_t)H * D;
  global Term* kto = kt + ((size_t)vh * panels + n) * TERMS_OF(D) * KEYS;
  global Term* vpo = vp + ((size_t)vh * panels + n) * TERMS_OF(KEYS) * HEAD_PAD;
  const int count = min(KEYS, T - n * KEYS);
#ifdef PAIRS
  k += (size_t)n * KEYS * row, values += (size_t)n * KEYS * row;
  for (int j = 0; j < KEYS; ++j)
    for (int d = 0; d < D; d += 16) {
      uint pairs[8];
      vstore8(pairs_along(load_part(k + (size_t)min(j, count - 1) * row + d, D - d)), 0, pairs);
      for (int i = 0; i < min(8, TERMS_OF(D - d)); ++i) kto[(d / 2 + i) * KEYS + j] = j < count ? pairs[i] : 0u;
    }
  for (int j = 0; j < KEYS; j += 2)
    for (int d = 0; d < HEAD_PAD; d += 16) {
      global const float* first = values + (size_t)j * row + d;
      const float16 one = load_part(first, j < count ? D - d : 0);
      const float16 other = load_part(first + row, j + 1 < count ? D - d : 0);
      vstore16(pairs_of(one, other), 0, vpo + j / 2 * HEAD_PAD + d);
    }
#else
  for (int d = 0; d < D; ++d)
    for (int j = 0; j < KEYS; ++j) kto[d * KEYS + j] = j < count ? k[(size_t)(n * KEYS + j) * row + d] : 0.0f;
  for (int j = 0; j < KEYS; ++j)
    for (int d = 0; d < HEAD_PAD; ++d)
      vpo[j * HEAD_PAD + d] = j < count && d < D ? values[(size_t)(n * KEYS + j) * row + d] : 0.0f;
#endif
}

// The running softmax of a tile's queries.
typedef struct {
  float16 total[ROWS];  // sums of the weights 2^(score - largest) so far, lane by lane
  float largest[ROWS];  // score so far
  float decay[ROWS];    // factor that the last step applied to earlier sums
} Softmax;

#define TILE_MASK(i)                                  \
  lo##i = select(lo##i, (float16)(-INFINITY), gone0); \
  hi##i = select(hi##i, (float16)(-INFINITY), gone1);
#define TILE_SCORE(i)                             \
  vstore16(lo##i, 0, p + (i)*STEP + column);      \
  vstore16(hi##i, 0, p + (i)*STEP + column + 16); \
  high[i] = max(high[i], max(lo##i, hi##i));

// Scores of the queries q (TOKEN_AT) with a panel of keys b [D, KEYS], D in terms: written to p [ROWS, STEP] from
// `column` on. If `beyond` > 0, the last `beyond` keys of the panel do not exist and have score -infinity. high [ROWS]:
// the largest scores, lane by lane, updated.
#ifdef MATRIX_AMX
static inline void tile_scores(const Term* q, global const Term* b, int D, int beyond, int column, float* p,
                               float16* high) {
  amx_product(q, b, p, column);
  const float16 lane = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (int i = 0; i < ROWS; ++i)
    for (int half_way = 0; half_way < KEYS; half_way += 16) {
      float* at = p + i * STEP + column + half_way;
      const int16 gone = lane + (float)half_way >= (float)(KEYS - beyond);
      const float16 scores = select(vload16(0, at), (float16)(-INFINITY), gone);
      if (beyond > 0) vstore16(scores, 0, at);
      high[i] = max(high[i], scores);
    }
}
#else
static inline void tile_scores(const Term* q, global const Term* b, int D, int beyond, int column, float* p,
                               float16* high) {
  EACH_ROW(TILE_ZERO)
  for (int d = 0; d < TERMS_OF(D); ++d) {
    const Term16 b0_ = vload16(0, b + d * KEYS), b1_ = vload16(0, b + d * KEYS + 16);
    const Term* a_ = q + d * ROWS;
    const int a_step_ = 1;
    EACH_ROW(TILE_FMA)
  }
  if (beyond > 0) {
    const float16 lane = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const int16 gone0 = lane >= (float)(KEYS - beyond), gone1 = lane + 16.0f >= (float)(KEYS - beyond);
    EACH_ROW(TILE_MASK)
  }
  EACH_ROW(TILE_SCORE)
}
#endif

// Turns the first `count` scores of each row of p [ROWS, STEP] into weights w [ROWS, STEP in terms].
static inline void softmax_step(Softmax* state, const float16* high, int count, const float* p, Term* w) {
  for (int i = 0; i < ROWS; ++i) {
    const float before = state->largest[i], top = max(before, max_of(high[i]));
    const float decay = before == top ? 1.0f : exp2(before - top);
    state->decay[i] = decay;
    state->largest[i] = top;
    float16 sum = state->total[i] * decay;
    for (int j = 0; j < count; j += 16) {
      const float16 e = exp2_16(vload16(0, p + i * STEP + j) - top);
      store_terms(e, i * STEP + j, w);
      sum += e;
    }
    state->total[i] = sum;
  }
}

#define TILE_OUT_LOAD(i)                                            \
  float16 lo##i = vload16(0, o + (i)*HEAD_PAD + column) * decay[i]; \
  float16 hi##i = vload16(0, o + (i)*HEAD_PAD + column + 16) * decay[i];

// o [ROWS, HEAD_PAD] = decay o + w values, for the first `count` columns of w [ROWS, STEP], and values [count,
// HEAD_PAD]; columns in terms.
static inline void add_values(const Term* w, global const Term* values, int count, const float* decay, float* o) {
#ifdef MATRIX_AMX
  for (int i = 0; i < ROWS; ++i)
    for (int d = 0; d < HEAD_PAD; d += 16)
      vstore16(vload16(0, o + i * HEAD_PAD + d) * decay[i], 0, o + i * HEAD_PAD + d);
  amx_add(w, values, count, o);
#else
  for (int column = 0; column < HEAD_PAD; column += 32) {
    EACH_ROW(TILE_OUT_LOAD)
    for (int j = 0; j < TERMS_OF(count); ++j) {
      const Term16 b0_ = vload16(0, values + j * HEAD_PAD + column),
                   b1_ = vload16(0, values + j * HEAD_PAD + column + 16);
      const Term* a_ = w + j;
      const int a_step_ = TERMS_OF(STEP);
      EACH_ROW(TILE_FMA)
    }
    EACH_ROW(TILE_KEEP)
  }
#endif
}

kernel void attention_forward_cpu(global const float* qkv, global const Term* kt, global const Term* vp,
                                  global float* out, global float* stats, int V, int T, int H, int D, float scale) {
  const int t0 = get_global_id(0) * ROWS, vh = get_global_id(1);
  if (t0 >= T || vh >= V * H) return;
  const int v = vh / H, h = vh % H, rows = min(ROWS, T - t0), panels = DIV_UP(T, KEYS);
  Term q[TERMS_OF(HEAD_PAD) * ROWS];  // TOKEN_AT, scaled for base 2
  float o[ROWS * HEAD_PAD], p[ROWS * STEP];
#ifdef PAIRS
  uint w[ROWS * TERMS_OF(STEP)];
#else
  float* w = p;
#endif
  Softmax state;
  for (int i = 0; i < ROWS; ++i) {
    global const float* from = qkv + ((size_t)(v * T + min(t0 + i, T - 1)) * 3 * H + h) * D;
#ifdef PAIRS
    for (int d = 0; d < D; d += 2)
      q[TOKEN_AT(d / 2, i)] =
          pair_of(from[d] * (scale * LOG2E), d + 1 < D ? from[min(d + 1, D - 1)] * (scale * LOG2E) : 0.0f);
#else
    for (int d = 0; d < D; ++d) q[TOKEN_AT(d, i)] = from[d] * (scale * LOG2E);
#endif
    for (int d = 0; d < HEAD_PAD; d += 16) vstore16((float16)(0.0f), 0, o + i * HEAD_PAD + d);
    state.total[i] = (float16)(0.0f);
    state.largest[i] = -INFINITY;
  }
  PRODUCTS_BEGIN
  for (int n0 = 0; n0 < panels; n0 += PANELS) {
    const int here = min(PANELS, panels - n0);
    const size_t first = (size_t)vh * panels + n0;
    float16 high[ROWS];
    for (int i = 0; i < ROWS; ++i) high[i] = (float16)(-INFINITY);
    for (int n = 0; n < here; ++n)
      tile_scores(q, kt + (first + n) * TERMS_OF(D) * KEYS, D, (n0 + n + 1) * KEYS - T, n * KEYS, p, high);
    softmax_step(&state, high, here * KEYS, p, w);
    add_values(w, vp + first * TERMS_OF(KEYS) * HEAD_PAD, here * KEYS, state.decay, o);
  }
  PRODUCTS_END
  for (int i = 0; i < rows; ++i) {
    global float* to = out + ((size_t)(v * T + t0 + i) * H + h) * D;
    const float inverse = 1.0f / sum_of(state.total[i]);
    for (int d = 0; d < D; ++d) to[d] = o[i * HEAD_PAD + d] * inverse;
    if (stats) vstore2((float2)(state.largest[i], inverse), (size_t)vh * T + t0 + i, stats);
  }
}
