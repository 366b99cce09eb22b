// Gradients of multi-head self-attention without a T x T matrix, cpu flavour. With the scores s = q . k / sqrt(D), the
// weights p of a query's softmax, and the gradient g of the output:
//   dv = sum over queries of p g          ds = p (g . v - delta), delta = g . out
//   dq = sum over keys of ds k / sqrt(D)  dk = sum over queries of ds q / sqrt(D)
// The scores are computed again twice, and p follows from them and from the forward's statistics: once by query, for
// dq, and once by key, for dk and dv. So every sum has one owner and one order.
// ```
// argument         type   shape                  what
// qkv              f32    [V,T,3,H,D]            as the forward took it; any sizes >= 1
// out              f32    [V,T,H D]              as the forward wrote it
// stats            f32    [V,H,T,2]              as the forward wrote it
// dout             f32    [V,T,H D]              gradient of out
// across           f32    [4,V H,N,D,32]         written by the packing: q (times log2(e) / sqrt(D)), k, v and dout by
//                                                panels of 32 tokens, transposed; N = ceil(T/32); zero beyond T
// along            f32    [3,V H,32 N,HEAD_PAD]  written by the packing: q (scaled likewise), k and dout, token by
//                                                token; zero beyond T and beyond channel D
// terms            f32    [V H,N,3,32]           written by the packing: each query's largest score, inverse sum and
//                                                delta; zero beyond T
// dqkv             f32    [V,T,3,H,D]            written: dq by attention_backward_by_query, dk and dv by
//                                                attention_backward_by_key
// scale            float                         1 / sqrt(D)
// define HEAD_PAD  64                            D rounded up to a multiple of 32
// define PAIRS                                   mixed precision: across is u32 [4,V H,N,ceil(D/2),32], pairs of
//                                                neighbouring channels, and along u32 [3,V H,16 N,HEAD_PAD], of
//                                                neighbouring tokens (pairs_cpu.clh); weights and their gradients are
//                                                rounded, too, delta is not
// work-items       groups of one
// ```
#include "attention_tile_cpu.clh"

#define LN2 0.69314718055994531f

// Two numbers `step` apart as a pair, the second one if it exists, or the number at `from`.
#ifdef PAIRS
#define TERM_AT(from, step, exists, by) pair_of((from)[0] * (by), (exists) ? (from)[step] * (by) : 0.0f)
#else
#define TERM_AT(from, step, exists, by) ((from)[0] * (by))
#endif
#define IN_TERM (KEYS / TERMS_OF(KEYS))  // numbers of a term

// Work-items (panel, v H + h, one of q, k, v, dout).
kernel void attention_backward_pack(global const float* qkv, global const float* out, global const float* stats,
                                    global const float* dout, global Term* across, global Term* along,
                                    global float* terms, int V, int T, int H, int D, float scale) {
  const int n = get_global_id(0), vh = get_global_id(1), which = get_global_id(2);
  const int panels = DIV_UP(T, KEYS), v = vh / H, h = vh % H, count = min(KEYS, T - n * KEYS);
  const size_t heads = (size_t)V * H, step = (which == 3 ? 1 : 3) * (size_t)H * D;
  global const float* from = which == 3 ? dout + (size_t)h * D : qkv + (size_t)(which * H + h) * D;
  from += ((size_t)v * T + (size_t)n * KEYS) * step;
  const float by = which == 0 ? scale * LOG2E : 1.0f;
  global Term* to = across + (((size_t)which * heads + vh) * panels + n) * TERMS_OF(D) * KEYS;
  for (int d = 0; d < D; d += IN_TERM)
    for (int j = 0; j < KEYS; ++j)
      to[d / IN_TERM * KEYS + j] = j < count ? TERM_AT(from + j * step + d, 1, d + 1 < D, by) : 0;
  if (which == 2) return;
  to = along + (((size_t)(which == 3 ? 2 : which) * heads + vh) * panels + n) * TERMS_OF(KEYS) * HEAD_PAD;
  for (int j = 0; j < KEYS; j += IN_TERM)
    for (int d = 0; d < HEAD_PAD; ++d)
      to[j / IN_TERM * HEAD_PAD + d] = j < count && d < D ? TERM_AT(from + j * step + d, step, j + 1 < count, by) : 0;
  if (which != 3) return;
  global float* rows = terms + ((size_t)vh * panels + n) * 3 * KEYS;
  for (int j = 0; j < KEYS; ++j) {
    float2 row = (float2)(0.0f, 0.0f);
    float delta = 0.0f;
    if (j < count) {
      row = vload2((size_t)vh * T + n * KEYS + j, stats);
      global const float* o = out + (((size_t)v * T + n * KEYS + j) * H + h) * D;
      for (int d = 0; d < D; ++d) delta += from[j * step + d] * o[d];
    }
    rows[j] = row.x;
    rows[KEYS + j] = row.y;
    rows[2 * KEYS + j] = delta;
  }
}

// Loads a (TOKEN_AT) for ROWS tokens from t0 on, from `across` of their head. Tokens beyond T repeat the last
// one; their results are not stored.
static inline void load_rows(global const Term* across, int t0, int T, int D, Term* a) {
  for (int i = 0; i < ROWS; ++i) {
    const int t = min(t0 + i, T - 1);
    global const Term* from = across + (size_t)(t / KEYS) * TERMS_OF(D) * KEYS + t % KEYS;
    for (int d = 0; d < TERMS_OF(D); ++d) a[TOKEN_AT(d, i)] = from[d * KEYS];
  }
}

// to [ROWS, STEP], columns column .. column + 31: a^T b, for a (TOKEN_AT) and a panel b [D, KEYS], D in terms.
static inline void tile_product(const Term* a, global const Term* b, int D, float* to, int column) {
#ifdef MATRIX_AMX
  amx_product(a, b, to, column);
#else
  EACH_ROW(TILE_ZERO)
  for (int d = 0; d < TERMS_OF(D); ++d) {
    const Term16 b0_ = vload16(0, b + d * KEYS), b1_ = vload16(0, b + d * KEYS + 16);
    const Term* a_ = a + d * ROWS;
    const int a_step_ = 1;
    EACH_ROW(TILE_FMA)
  }
#define TILE_PUT(i)                           \
  vstore16(lo##i, 0, to + (i)*STEP + column); \
  vstore16(hi##i, 0, to + (i)*STEP + column + 16);
  EACH_ROW(TILE_PUT)
#endif
}

// o [ROWS, HEAD_PAD] += w b, for the first `count` columns of w [ROWS, STEP], and b [count, HEAD_PAD]; columns in
// terms.
static inline void tile_add(const Term* w, global const Term* b, int count, float* o) {
#ifdef MATRIX_AMX
  amx_add(w, b, count, o);
#else
  for (int column = 0; column < HEAD_PAD; column += 32) {
#define TILE_TAKE(i) \
  float16 lo##i = vload16(0, o + (i)*HEAD_PAD + column), hi##i = vload16(0, o + (i)*HEAD_PAD + column + 16);
    EACH_ROW(TILE_TAKE)
    for (int j = 0; j < TERMS_OF(count); ++j) {
      const Term16 b0_ = vload16(0, b + j * HEAD_PAD + column), b1_ = vload16(0, b + j * HEAD_PAD + column + 16);
      const Term* a_ = w + j;
      const int a_step_ = TERMS_OF(STEP);
      EACH_ROW(TILE_FMA)
    }
    EACH_ROW(TILE_KEEP)
  }
#endif
}

// dq. Work-items (ROWS queries, v H + h).
kernel void attention_backward_by_query(global const Term* across, global const Term* along, global const float* terms,
                                        global float* dqkv, int V, int T, int H, int D, float scale) {
  const int t0 = get_global_id(0) * ROWS, vh = get_global_id(1);
  if (t0 >= T || vh >= V * H) return;
  const int v = vh / H, h = vh % H, panels = DIV_UP(T, KEYS);
  const size_t panel = (size_t)TERMS_OF(D) * KEYS, wide = (size_t)V * H * panels * panel;
  const size_t rows = (size_t)TERMS_OF(KEYS) * HEAD_PAD, high = (size_t)V * H * panels * rows;
  across += (size_t)vh * panels * panel;
  along += (size_t)vh * panels * rows;
  Term q[TERMS_OF(HEAD_PAD) * ROWS], g[TERMS_OF(HEAD_PAD) * ROWS], w[ROWS * TERMS_OF(STEP)];
  float o[ROWS * HEAD_PAD], s[ROWS * STEP], dp[ROWS * STEP];
  load_rows(across, t0, T, D, q);
  load_rows(across + 3 * wide, t0, T, D, g);
  for (int i = 0; i < ROWS * HEAD_PAD; ++i) o[i] = 0.0f;
  const float16 lane = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  PRODUCTS_BEGIN
  for (int n0 = 0; n0 < panels; n0 += PANELS) {
    const int here = min(PANELS, panels - n0);
    for (int n = 0; n < here; ++n) {
      tile_product(q, across + wide + (n0 + n) * panel, D, s, n * KEYS);
      tile_product(g, across + 2 * wide + (n0 + n) * panel, D, dp, n * KEYS);
    }
    for (int i = 0; i < ROWS; ++i) {
      const int t = min(t0 + i, T - 1);
      global const float* of = terms + ((size_t)vh * panels + t / KEYS) * 3 * KEYS + t % KEYS;
      const float top = of[0], inverse = of[KEYS], delta = of[2 * KEYS];
      for (int j = 0; j < here * KEYS; j += 16) {
        const float16 p = exp2_16(vload16(0, s + i * STEP + j) - top) * inverse;
        const float16 ds = p * (vload16(0, dp + i * STEP + j) - delta);
        // A key beyond T has score 0, which may be far above the other scores: its gradient is set to 0.
        const int16 gone = lane >= (float)(T - n0 * KEYS - j);
        store_terms(select(ds, (float16)(0.0f), gone), i * STEP + j, w);
      }
    }
    tile_add(w, along + high + n0 * rows, here * KEYS, o);
  }
  PRODUCTS_END
  for (int i = 0; i < min(ROWS, T - t0); ++i) {
    global float* to = dqkv + ((size_t)(v * T + t0 + i) * 3 * H + h) * D;
    for (int d = 0; d < D; ++d) to[d] = o[i * HEAD_PAD + d] * scale;
  }
}

// dk and dv. Work-items (ROWS keys, v H + h).
kernel void attention_backward_by_key(global const Term* across, global const Term* along, global const float* terms,
                                      global float* dqkv, int V, int T, int H, int D) {
  const int t0 = get_global_id(0) * ROWS, vh = get_global_id(1);
  if (t0 >= T || vh >= V * H) return;
  const int v = vh / H, h = vh % H, panels = DIV_UP(T, KEYS);
  const size_t panel = (size_t)TERMS_OF(D) * KEYS, wide = (size_t)V * H * panels * panel;
  const size_t rows = (size_t)TERMS_OF(KEYS) * HEAD_PAD, high = (size_t)V * H * panels * rows;
  across += (size_t)vh * panels * panel;
  along += (size_t)vh * panels * rows;
  Term k[TERMS_OF(HEAD_PAD) * ROWS], values[TERMS_OF(HEAD_PAD) * ROWS];
  Term wk[ROWS * TERMS_OF(STEP)], wv[ROWS * TERMS_OF(STEP)];
  float p[ROWS * STEP], ds[ROWS * STEP], ok[ROWS * HEAD_PAD], ov[ROWS * HEAD_PAD];
  load_rows(across + wide, t0, T, D, k);
  load_rows(across + 2 * wide, t0, T, D, values);
  for (int i = 0; i < ROWS * HEAD_PAD; ++i) ok[i] = ov[i] = 0.0f;
  PRODUCTS_BEGIN
  for (int n0 = 0; n0 < panels; n0 += PANELS) {
    const int here = min(PANELS, panels - n0);
    for (int n = 0; n < here; ++n) {
      tile_product(k, across + (n0 + n) * panel, D, p, n * KEYS);
      tile_product(values, across + 3 * wide + (n0 + n) * panel, D, ds, n * KEYS);
    }
    // Queries beyond T have an inverse sum of 0, and so weight 0.
    global const float* of = terms + ((size_t)vh * panels + n0) * 3 * KEYS;
    for (int j = 0; j < here * KEYS; j += 16) {
      global const float* term = of + (j / KEYS) * 3 * KEYS + j % KEYS;
      const float16 top = vload16(0, term), inverse = vload16(0, term + KEYS), delta = vload16(0, term + 2 * KEYS);
      for (int i = 0; i < ROWS; ++i) {
        const float16 weight = exp2_16(vload16(0, p + i * STEP + j) - top) * inverse;
        store_terms(weight, i * STEP + j, wv);
        store_terms(weight * (vload16(0, ds + i * STEP + j) - delta), i * STEP + j, wk);
      }
    }
    tile_add(wk, along + n0 * rows, here * KEYS, ok);
    tile_add(wv, along + 2 * high + n0 * rows, here * KEYS, ov);
  }
  PRODUCTS_END
  for (int i = 0; i < min(ROWS, T - t0); ++i) {
    global float* dk = dqkv + ((size_t)((v * T + t0 + i) * 3 + 1) * H + h) * D;
    global float* dv = dk + (size_t)H * D;
    for (int d = 0; d < D; ++d) {
      dk[d] = ok[i * HEAD_PAD + d] * LN2;  // q is scaled by log2(e) / sqrt(D)
      dv[d] = ov[i * HEAD_PAD + d];
    }
  }
}
