// The similarity of loss.cl on a CPU: a work-item processes a row of a picture, 16 numbers at a time. Arguments and
// results are equal.
#include "loss.clh"
#include "vector16.clh"

// ```
// arguments   as in loss.cl
// work-items  one per row
// ```
kernel void loss_rows(global const float* restrict m, global const float* restrict d, global float* restrict rows,
                      int V3, int R) {
  const int y = get_global_id(0);
  if (y >= R) return;
  const size_t plane = (size_t)R * V3;
  m += (size_t)y * (V3 + 3 * (WINDOW - 1));
  d += (size_t)y * (V3 + 3 * (WINDOW - 1));
  rows += (size_t)y * V3;
  for (int j = 0; j < V3; j += 16) {
    float16 sm = 0.0f, sd = 0.0f, smm = 0.0f, sdd = 0.0f;
    for (int k = 0; k < WINDOW; ++k) {
      const float16 vm = load_part(m + j + 3 * k, V3 - j), vd = load_part(d + j + 3 * k, V3 - j);
      sm = FMA(window[k], vm, sm);
      sd = FMA(window[k], vd, sd);
      smm = FMA(window[k], vm * vm, smm);
      sdd = FMA(window[k], vd * vd, sdd);
    }
    store_part(sm, V3 - j, rows + j);
    store_part(sd, V3 - j, rows + j + plane);
    store_part(smm, V3 - j, rows + j + 2 * plane);
    store_part(sdd, V3 - j, rows + j + 3 * plane);
  }
}

DEFINE_SIMILARITY(float16)

// ```
// arguments   as in loss.cl
// work-items  one per row that is written
// ```
kernel void loss_maps(global const float* restrict rows, global float* restrict off, global float* restrict slopes,
                      int V3, int H, int N, int structure) {
  const int valid = H - WINDOW + 1, row = get_global_id(0), y = row % valid, n = row / valid;
  if (n >= N) return;
  const size_t plane = (size_t)N * H * V3, step = (size_t)N * valid * V3;
  rows += ((size_t)n * H + y) * V3;
  off += (size_t)row * V3;
  if (slopes) slopes += (size_t)row * V3;
  for (int j = 0; j < V3; j += 16) {
    float16 M = 0.0f, D = 0.0f, smm = 0.0f, sdd = 0.0f;
    for (int k = 0; k < WINDOW; ++k) {
      global const float* at = rows + (size_t)k * V3 + j;
      M = FMA(window[k], load_part(at, V3 - j), M);
      D = FMA(window[k], load_part(at + plane, V3 - j), D);
      smm = FMA(window[k], load_part(at + 2 * plane, V3 - j), smm);
      sdd = FMA(window[k], load_part(at + 3 * plane, V3 - j), sdd);
    }
    const Similarity_float16 s = similarity_float16(M, D, smm, sdd, structure);
    store_part(s.off, V3 - j, off + j);
    if (!slopes) continue;
    store_part(s.by_x, V3 - j, slopes + j);
    store_part(s.by_vm, V3 - j, slopes + j + step);
    store_part(s.by_vd, V3 - j, slopes + j + 2 * step);
  }
}

// ```
// arguments   as in loss.cl
// work-items  one per row that is written, of all 3N fields
// ```
kernel void loss_backward_spread(global const float* restrict slopes, global float* restrict spread, int V3, int H,
                                 int fields) {
  const int pad = 3 * (WINDOW - 1), valid = H - WINDOW + 1;
  const int row = get_global_id(0), y = row % H, n = row / H;
  if (n >= fields) return;
  const int first = max(0, y - valid + 1), last = min(WINDOW - 1, y);
  slopes += (size_t)n * valid * V3;
  spread += (size_t)row * (V3 + 2 * pad);
  for (int j = 0; j < pad; ++j) spread[j] = spread[V3 + pad + j] = 0.0f;
  for (int j = 0; j < V3; j += 16) {
    float16 sum = 0.0f;
    for (int k = first; k <= last; ++k) sum = FMA(window[k], load_part(slopes + (size_t)(y - k) * V3 + j, V3 - j), sum);
    store_part(sum, V3 - j, spread + pad + j);
  }
}

// The values of a picture's planes in rotation, starting with that of number j, a multiple of 16.
static inline float16 in_turn(global const float* by, int j) {
  const float3 v = vload3(0, by);
  const float16 turns = (float16)(v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x);
  const float16 next = (float16)(v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y);
  const float16 last = (float16)(v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z, v.x, v.y, v.z);
  return j % 3 == 0 ? turns : j % 3 == 1 ? next : last;
}

// ```
// arguments   as in loss.cl
// work-items  one per row
// ```
kernel void loss_backward(global const float* restrict spread, global const float* restrict m,
                          global const float* restrict d, global const float* restrict by,
                          global const float* restrict coarser, global const float* restrict pictures,
                          global float* restrict dpictures, int H, int W, int N, int first, float error, int absolute) {
  const int pad = 3 * (WINDOW - 1), row = get_global_id(0), y = row % H, n = row / H, width = 3 * W;
  if (n >= N) return;
  const size_t plane = (size_t)N * H * (width + pad), at = (size_t)row * width;
  spread += (size_t)row * (width + pad) + pad;
  for (int j = 0; j < width; j += 16) {
    const int left = width - j;
    float16 s0 = 0.0f, s1 = 0.0f, s2 = 0.0f;
    for (int k = 0; k < WINDOW; ++k) {
      s0 = FMA(window[k], load_part(spread + j - 3 * k, left), s0);
      s1 = FMA(window[k], load_part(spread + j + plane - 3 * k, left), s1);
      s2 = FMA(window[k], load_part(spread + j + 2 * plane - 3 * k, left), s2);
    }
    const float16 off = load_part(d + at + j, left);
    float16 sum = in_turn(by + first + 3 * n, j) * (s0 + load_part(m + at + j, left) * s1 + 2.0f * off * s2);
    if (coarser) {
      const int h = DIV_UP(H, 2), w = DIV_UP(W, 2);
      global const float* from = coarser + ((size_t)n * h + (y + H % 2) / 2) * 3 * w;
      float more[16];
      for (int i = 0; i < 16; ++i) more[i] = i < left ? from[((j + i) / 3 + W % 2) / 2 * 3 + (j + i) % 3] : 0.0f;
      sum += 0.25f * vload16(0, more);
    }
    if (pictures) {
      const float16 x = load_part(pictures + at + j, left);
      const float16 sign = off > 0.0f ? (float16)(1.0f) : off < 0.0f ? (float16)(-1.0f) : off;
      sum = FMA(error, absolute ? sign : off, sum);
      sum = (x < 0.0f) | (x > 1.0f) ? (float16)(0.0f) : sum;
    }
    store_part(sum, left, dpictures + at + j);
  }
}
