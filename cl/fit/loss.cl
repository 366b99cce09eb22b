// The loss on pictures, mean squared or absolute error and structural similarity (SSIM), with its gradient.
//
// Pictures are [N,H,W,3]; a row is W3 = 3 W numbers, in which a pixel's neighbour is 3 further on. Blurred fields exist
// at the pixels whose 11 x 11 window lies inside the picture: H - 10 rows of V3 = 3 (W - 10) numbers. Kernels that sum
// nothing have work-items (j, y, n): a number of the row (guarded), row, picture.
//
// With the picture x clamped to [0, 1] and the target t, everything is in m = (x + t) / 2 - 1/2 and d = x - t: 1 - SSIM
// is small where d is, and so comes out without the cancellation of nearly equal variances. With the blur B, M = B m, D
// = B d,
//   vm = B m^2 - M^2, vd = B d^2 - D^2, D1 = 2 (M + 1/2)^2 + D^2/2 + c1, D2 = 2 vm + vd/2 + c2 :
//   luminance l = 1 - D^2/D1, contrast and structure cs = 1 - vd/D2, SSIM = l cs
// which is Wang et al. 2004 with a = M + 1/2 + D/2 and b = M + 1/2 - D/2. The blurring kernels are for GPUs;
// loss_cpu.cl has them by rows.
// ```
// define        default  what
// define GROUP  64       work-items of a group that sums, a power of two
// define EACH   32       pixels of each of them
// ```
#include "loss.clh"

#ifndef GROUP
#define GROUP 64
#endif
#ifndef EACH
#define EACH 32
#endif

// The built-in sign() returns 0 for NaN; this one keeps NaN.
static inline float sign_of(float x) { return x > 0.0f ? 1.0f : x < 0.0f ? -1.0f : x; }

// ```
// argument    type  shape    what
// pictures    f32   [count]  pictures, not clamped
// target      f32   [count]  targets
// m, d        f32   [count]  written
// work-items  one per number
// ```
kernel void loss_differences(global const float* restrict pictures, global const float* restrict target,
                             global float* restrict m, global float* restrict d, int count) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float raw = pictures[i];
  const float x = raw < 0.0f ? 0.0f : raw > 1.0f ? 1.0f : raw;  // NaN stays
  m[i] = 0.5f * (x + target[i]) - 0.5f;
  d[i] = x - target[i];
}

// Halves m and d on both sides: means of 2 x 2 pixels. An odd side gets a row of x = t = 0 before its first, as
// avg_pool2d pads.
// ```
// argument        type  shape     what
// m, d            f32   [N,H,W3]  at one scale
// half_m, half_d  f32   [N,h,3w]  written, h = ceil(H/2), w = ceil(W/2)
// ```
kernel void loss_halve(global const float* restrict m, global const float* restrict d, global float* restrict half_m,
                       global float* restrict half_d, int H, int W) {
  const int j = get_global_id(0), y = get_global_id(1), n = get_global_id(2);
  const int h = DIV_UP(H, 2), w = DIV_UP(W, 2);
  if (j >= 3 * w) return;
  float sum_m = 0.0f, sum_d = 0.0f;
  for (int i = 0; i < 4; ++i) {
    const int from_y = 2 * y - H % 2 + i / 2, from_x = 2 * (j / 3) - W % 2 + i % 2;
    const bool inside = from_y >= 0 && from_x >= 0;
    const size_t from = ((size_t)n * H + (inside ? from_y : 0)) * 3 * W + (inside ? from_x : 0) * 3 + j % 3;
    sum_m += inside ? m[from] : -0.5f;
    sum_d += inside ? d[from] : 0.0f;
  }
  const size_t to = ((size_t)n * h + y) * 3 * w + j;
  half_m[to] = 0.25f * sum_m;
  half_d[to] = 0.25f * sum_d;
}

// Blurs along x.
// ```
// argument    type  shape     what
// m, d        f32   [R,W3]    the rows of all pictures, R = N H
// rows        f32   [4,R,V3]  written: m, d, m^2, d^2 blurred
// work-items  (j, row)
// ```
kernel void loss_rows(global const float* restrict m, global const float* restrict d, global float* restrict rows,
                      int V3, int R) {
  const int j = get_global_id(0), y = get_global_id(1);
  if (j >= V3) return;
  const size_t from = (size_t)y * (V3 + 3 * (WINDOW - 1)) + j, to = (size_t)y * V3 + j, plane = (size_t)R * V3;
  float sm = 0.0f, sd = 0.0f, smm = 0.0f, sdd = 0.0f;
  for (int k = 0; k < WINDOW; ++k) {
    const float vm = m[from + 3 * k], vd = d[from + 3 * k];
    sm = FMA(window[k], vm, sm);
    sd = FMA(window[k], vd, sd);
    smm = FMA(window[k], vm * vm, smm);
    sdd = FMA(window[k], vd * vd, sdd);
  }
  rows[to] = sm;
  rows[to + plane] = sd;
  rows[to + 2 * plane] = smm;
  rows[to + 3 * plane] = sdd;
}

DEFINE_SIMILARITY(float)

// Blurs along y, and computes the similarity.
// ```
// argument  type  shape          what
// rows      f32   [4,N,H,V3]     from loss_rows
// off       f32   [N,H-10,V3]    written: 1 - SSIM, or 1 - cs where `structure` is not 0
// slopes    f32   [3,N,H-10,V3]  written: derivatives of off by M and D together, as x moves them (half of the one and
//                                the whole of the other), by B m^2, and by B d^2; null: not wanted
// ```
kernel void loss_maps(global const float* restrict rows, global float* restrict off, global float* restrict slopes,
                      int V3, int H, int N, int structure) {
  const int j = get_global_id(0), y = get_global_id(1), n = get_global_id(2);
  if (j >= V3) return;
  const size_t from = ((size_t)n * H + y) * V3 + j, plane = (size_t)N * H * V3;
  float M = 0.0f, D = 0.0f, smm = 0.0f, sdd = 0.0f;
  for (int k = 0; k < WINDOW; ++k) {
    const size_t at = from + (size_t)k * V3;
    M = FMA(window[k], rows[at], M);
    D = FMA(window[k], rows[at + plane], D);
    smm = FMA(window[k], rows[at + 2 * plane], smm);
    sdd = FMA(window[k], rows[at + 3 * plane], sdd);
  }
  const Similarity_float s = similarity_float(M, D, smm, sdd, structure);
  const int valid = H - WINDOW + 1;
  const size_t to = ((size_t)n * valid + y) * V3 + j, step = (size_t)N * valid * V3;
  off[to] = s.off;
  if (!slopes) return;
  slopes[to] = s.by_x;
  slopes[to + step] = s.by_vm;
  slopes[to + 2 * step] = s.by_vd;
}

// The transpose of the blur along y.
// ```
// argument  type  shape         what
// slopes    f32   [3N,H-10,V3]  from loss_maps
// spread    f32   [3N,H,V3+60]  written; rows begin and end with 30 zeros
// fields    int                 3N
// ```
kernel void loss_backward_spread(global const float* restrict slopes, global float* restrict spread, int V3, int H,
                                 int fields) {
  const int pad = 3 * (WINDOW - 1), valid = H - WINDOW + 1;
  const int j = get_global_id(0), y = get_global_id(1), n = get_global_id(2);
  if (j >= V3 + 2 * pad || n >= fields) return;
  float sum = 0.0f;
  if (j >= pad && j < V3 + pad) {
    const int first = max(0, y - valid + 1), last = min(WINDOW - 1, y);
    for (int k = first; k <= last; ++k) sum = FMA(window[k], slopes[((size_t)n * valid + y - k) * V3 + j - pad], sum);
  }
  spread[((size_t)n * H + y) * (V3 + 2 * pad) + j] = sum;
}

// The gradient at one scale: the transpose of the blur along x.
// ```
// argument   type  shape          what
// spread     f32   [3,N,H,V3+60]  from loss_backward_spread
// m, d       f32   [N,H,W3]       at this scale
// by         f32   [..]           by[first + 3 n + c] is the loss's derivative by a value of off, for plane c of
//                                 picture n
// coarser    f32   [N,h,3w]       gradient of the next coarser scale; a quarter of it is added; null: none
// pictures   f32   [N,H,W3]       at the finest scale the input pictures: there error * d is added, and the
//                                 gradient is 0 where a picture is outside of [0, 1]; null at the others
// dpictures  f32   [N,H,W3]       written
// absolute   int                  if not 0, error * sign(d) is added instead
// ```
kernel void loss_backward(global const float* restrict spread, global const float* restrict m,
                          global const float* restrict d, global const float* restrict by,
                          global const float* restrict coarser, global const float* restrict pictures,
                          global float* restrict dpictures, int H, int W, int N, int first, float error, int absolute) {
  const int pad = 3 * (WINDOW - 1);
  const int j = get_global_id(0), y = get_global_id(1), n = get_global_id(2), c = j % 3;
  if (j >= 3 * W) return;
  const size_t row = 3 * W + pad, plane = (size_t)N * H * row;
  const size_t from = ((size_t)n * H + y) * row + j + pad, at = ((size_t)n * H + y) * 3 * W + j;
  float s0 = 0.0f, s1 = 0.0f, s2 = 0.0f;
  for (int k = 0; k < WINDOW; ++k) {
    s0 = FMA(window[k], spread[from - 3 * k], s0);
    s1 = FMA(window[k], spread[from + plane - 3 * k], s1);
    s2 = FMA(window[k], spread[from + 2 * plane - 3 * k], s2);
  }
  float sum = by[first + 3 * n + c] * (s0 + m[at] * s1 + 2.0f * d[at] * s2);
  if (coarser) {
    const int h = DIV_UP(H, 2), w = DIV_UP(W, 2);
    sum += 0.25f * coarser[((size_t)n * h + (y + H % 2) / 2) * 3 * w + (j / 3 + W % 2) / 2 * 3 + c];
  }
  if (pictures) {
    sum = FMA(error, absolute ? sign_of(d[at]) : d[at], sum);
    if (pictures[at] < 0.0f || pictures[at] > 1.0f) sum = 0.0f;
  }
  dpictures[at] = sum;
}

// The gradient of only the error.
// ```
// argument    type  shape    what
// d           f32   [count]  from loss_differences
// pictures    f32   [count]  input pictures
// dpictures   f32   [count]  written: error * d, or error * sign(d); 0 where a picture is outside of [0, 1]
// work-items  one per number
// ```
kernel void loss_error_slopes(global const float* restrict d, global const float* restrict pictures,
                              global float* restrict dpictures, int count, float error, int absolute) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float slope = absolute ? sign_of(d[i]) : d[i];
  dpictures[i] = pictures[i] < 0.0f || pictures[i] > 1.0f ? 0.0f : error * slope;
}

// Sums of a picture's planes, of their squares or of their absolute values, over blocks of GROUP * EACH pixels.
// ```
// argument    type  shape         what
// x           f32   [N,pixels,3]  values to sum
// sums        f32   [N,blocks,3]  written
// of          int                 0: values are summed, 1: squares, 2: absolute values
// work-items  groups of GROUP: (block, n)
// ```
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void loss_sums(global const float* restrict x,
                                                                         global float* restrict sums, int pixels,
                                                                         int of) {
  local float part[3][GROUP];
  const int block = GROUP_ID(0), n = GROUP_ID(1), item = get_local_id(0);
  global const float* from = x + ((size_t)n * pixels + (size_t)block * GROUP * EACH) * 3;
  const int left = min(pixels - block * (GROUP * EACH), GROUP * EACH);
  float sum[3] = {0.0f, 0.0f, 0.0f};
  for (int i = item; i < left; i += GROUP)
    for (int c = 0; c < 3; ++c) {
      const float v = from[3 * i + c];
      sum[c] += of == 0 ? v : of == 1 ? v * v : fabs(v);
    }
  for (int c = 0; c < 3; ++c) part[c][item] = sum[c];
  for (int step = GROUP / 2; step > 0; step /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < step)
      for (int c = 0; c < 3; ++c) part[c][item] += part[c][item + step];
  }
  if (item == 0)
    for (int c = 0; c < 3; ++c) sums[((size_t)n * DIV_UP(pixels, GROUP * EACH) + block) * 3 + c] = part[c][0];
}

// Means from those sums, by Kahan's summation.
// ```
// argument    type  shape         what
// sums        f32   [N,blocks,3]  from loss_sums
// means       f32   [..]          means[first + i] is written, i = 3 n + c
// work-items  one per plane, 3 N of them
// ```
kernel void loss_means(global const float* restrict sums, global float* restrict means, int planes, int blocks,
                       int pixels, int first) {
  const int i = get_global_id(0);
  if (i >= planes) return;
  float sum = 0.0f, lost = 0.0f;
  for (int b = 0; b < blocks; ++b) {
    const float add = sums[((size_t)(i / 3) * blocks + b) * 3 + i % 3] - lost;
    const float next = sum + add;
    lost = (next - sum) - add;
    sum = next;
  }
  means[first + i] = sum / pixels;
}

// The loss from the means. Without scales there is no similarity. With one it is the mean of SSIM; with five it is the
// mean over planes of the product, over the scales, of the positive part of each to its power.
// ```
// argument    type   shape              what
// means       f32    [1+scales,planes]  of d^2 or |d|, then of off scale by scale
// out         f32    [3]                written: loss, mean error, similarity
// by          f32    [scales,planes]    written: input of loss_backward, times gradient_scale
// H, W        int                       of the pictures at the finest scale
// weight      float                     of the similarity in the loss
// work-items  one
// ```
kernel void loss_value(global const float* restrict means, global float* restrict out, global float* restrict by, int H,
                       int W, int planes, int scales, float weight, float gradient_scale) {
  const float power[5] = {0.0448f, 0.2856f, 0.3001f, 0.2363f, 0.1333f};
  float error = 0.0f, off = 0.0f;
  for (int i = 0; i < planes; ++i) error += means[i];
  for (int i = 0; i < (scales == 0 ? 0 : planes); ++i) {  // (with `continue` PoCL 7.1 makes a loop without an end)
    float product = 1.0f;
    if (scales == 1) {
      product = 1.0f - means[planes + i];
    } else {
      for (int s = 0; s < scales; ++s) {
        const float value = 1.0f - means[(1 + s) * planes + i];
        product *= value <= 0.0f ? 0.0f : pow(value, power[s]);
      }
    }
    off += scales == 1 ? means[planes + i] : 1.0f - product;
    for (int s = 0, h = H, w = W; s < scales; ++s, h = DIV_UP(h, 2), w = DIV_UP(w, 2)) {
      const float pixels = (float)(h - WINDOW + 1) * (w - WINDOW + 1);
      const float value = 1.0f - means[(1 + s) * planes + i];
      const float slope = scales == 1 ? 1.0f : product == 0.0f ? 0.0f : power[s] * product / value;
      by[s * planes + i] = gradient_scale * weight * slope / (planes * pixels);
    }
  }
  out[0] = (error + weight * off) / planes;
  out[1] = error / planes;
  out[2] = scales == 0 ? 0.0f : 1.0f - off / planes;
}
