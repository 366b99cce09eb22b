// The similarity of loss.cl on a CPU: a work-item processes a row of a picture, 16 numbers at a time, or where it blurs
// along y ROWS rows, which share what they read. Arguments and results are equal.
#include "loss.clh"
#include "vector16.clh"

#define ROWS 4

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

// ```
// arguments   as in loss.cl
// work-items  (block of 2048 pixels, n)
// ```
kernel void loss_sums(global const float* restrict x, global float* restrict sums, int pixels, int of) {
  const int block = get_global_id(0), n = get_global_id(1), left = 3 * min(pixels - block * 2048, 2048);
  if (left <= 0) return;
  global const float* from = x + ((size_t)n * pixels + (size_t)block * 2048) * 3;
  float16 part[3] = {0.0f, 0.0f, 0.0f};  // 48 numbers are 16 pixels
  for (int i = 0; i < left; i += 48)
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      const float16 v = load_part(from + i + 16 * k, left - i - 16 * k);
      part[k] += of == 0 ? v : of == 1 ? v * v : fabs(v);
    }
  float all[48], sum[3] = {0.0f, 0.0f, 0.0f};
  for (int k = 0; k < 3; ++k) vstore16(part[k], k, all);
  for (int i = 0; i < 48; ++i) sum[i % 3] += all[i];
  for (int c = 0; c < 3; ++c) sums[((size_t)n * DIV_UP(pixels, 2048) + block) * 3 + c] = sum[c];
}

DEFINE_SIMILARITY(float16)

// ```
// arguments   as in loss.cl
// work-items  one per ROWS rows that are written
// ```
kernel void loss_maps(global const float* restrict rows, global float* restrict off, global float* restrict slopes,
                      int V3, int H, int N, int structure) {
  const int valid = H - WINDOW + 1, blocks = DIV_UP(valid, ROWS);
  const int block = get_global_id(0), n = block / blocks, y0 = block % blocks * ROWS, count = min(valid - y0, ROWS);
  if (n >= N) return;
  const size_t plane = (size_t)N * H * V3, step = (size_t)N * valid * V3, to = ((size_t)n * valid + y0) * V3;
  rows += (size_t)n * H * V3;
  for (int j = 0; j < V3; j += 16) {
    float16 M[ROWS], D[ROWS], smm[ROWS], sdd[ROWS];
#pragma unroll
    for (int i = 0; i < ROWS; ++i) M[i] = D[i] = smm[i] = sdd[i] = 0.0f;
#pragma unroll
    for (int r = 0; r < WINDOW - 1 + ROWS; ++r) {
      global const float* at = rows + (size_t)min(y0 + r, H - 1) * V3 + j;
      const float16 vM = load_part(at, V3 - j), vD = load_part(at + plane, V3 - j);
      const float16 vmm = load_part(at + 2 * plane, V3 - j), vdd = load_part(at + 3 * plane, V3 - j);
#pragma unroll
      for (int i = 0; i < ROWS; ++i) {
        const int k = r - i;
        if (k < 0 || k >= WINDOW) continue;
        M[i] = FMA(window[k], vM, M[i]);
        D[i] = FMA(window[k], vD, D[i]);
        smm[i] = FMA(window[k], vmm, smm[i]);
        sdd[i] = FMA(window[k], vdd, sdd[i]);
      }
    }
#pragma unroll
    for (int i = 0; i < ROWS; ++i) {
      if (i >= count) break;
      const Similarity_float16 s = similarity_float16(M[i], D[i], smm[i], sdd[i], structure);
      const size_t here = to + (size_t)i * V3 + j;
      store_part(s.off, V3 - j, off + here);
      if (!slopes) continue;
      store_part(s.by_x, V3 - j, slopes + here);
      store_part(s.by_vm, V3 - j, slopes + here + step);
      store_part(s.by_vd, V3 - j, slopes + here + 2 * step);
    }
  }
}

// ```
// arguments   as in loss.cl
// work-items  one per ROWS rows that are written, of all 3N fields
// ```
kernel void loss_backward_spread(global const float* restrict slopes, global float* restrict spread, int V3, int H,
                                 int fields) {
  const int pad = 3 * (WINDOW - 1), valid = H - WINDOW + 1, blocks = DIV_UP(H, ROWS);
  const int block = get_global_id(0), n = block / blocks, y0 = block % blocks * ROWS, count = min(H - y0, ROWS);
  if (n >= fields) return;
  slopes += (size_t)n * valid * V3;
  spread += ((size_t)n * H + y0) * (V3 + 2 * pad);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < pad; ++j)
      spread[(size_t)i * (V3 + 2 * pad) + j] = spread[(size_t)i * (V3 + 2 * pad) + V3 + pad + j] = 0.0f;
  for (int j = 0; j < V3; j += 16) {
    float16 sum[ROWS];
#pragma unroll
    for (int i = 0; i < ROWS; ++i) sum[i] = 0.0f;
#pragma unroll
    for (int r = ROWS - 1; r > -WINDOW; --r) {  // downwards, so that each sum is in the order of k
      if (y0 + r < 0 || y0 + r >= valid) continue;
      const float16 v = load_part(slopes + (size_t)(y0 + r) * V3 + j, V3 - j);
#pragma unroll
      for (int i = 0; i < ROWS; ++i)
        if (i - r >= 0 && i - r < WINDOW) sum[i] = FMA(window[i - r], v, sum[i]);
    }
#pragma unroll
    for (int i = 0; i < ROWS; ++i)
      if (i < count) store_part(sum[i], V3 - j, spread + (size_t)i * (V3 + 2 * pad) + pad + j);
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
