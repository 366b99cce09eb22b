// The loss on pictures, mean squared error and structural similarity, with its gradient.   (f32)
// All are [N, H, W, 3]; a row is W3 = 3 W numbers, in which a pixel's neighbour is 3 further. Blurred fields are on the pixels
// whose 11 x 11 window lies inside: rows of V3 = 3 (W - 10), H - 10 of them. Kernels without sums: a work-item per number, j along
// dimension 0, guarded; y along 1; n along 2.
//
// With x clamped and the target t, everything is in m = (x + t) / 2 - 1/2 and d = x - t: 1 - SSIM is small where d is,
// and comes out without the cancellation of nearly equal variances. With B the blur, M = B m, D = B d,
//   vm = B m^2 - M^2, vd = B d^2 - D^2, D1 = 2 (M + 1/2)^2 + D^2/2 + c1, D2 = 2 vm + vd/2 + c2 :
//   luminance l = 1 - D^2/D1, contrast and structure cs = 1 - vd/D2, SSIM = l cs
// which is Wang et al. 2004 with a = M + 1/2 + D/2 and b = M + 1/2 - D/2.
#include "common.clh"

#define WINDOW 11
#ifndef GROUP
#define GROUP 64  // work-items of a group that sums, a power of two
#endif
#ifndef EACH
#define EACH 32  // pixels of each of them
#endif

// exp(-k^2 / (2 1.5^2)), k = -5 ... 5, over their sum
constant float window[WINDOW] = {0.00102838008f, 0.00759875814f, 0.0360007721f, 0.10936069f,
                                 0.213005538f,   0.266011725f,   0.213005538f,  0.10936069f,
                                 0.0360007721f,  0.00759875814f, 0.00102838008f};

// m, d of the pictures and their target, count numbers.
kernel void loss_differences(global const float* restrict pictures, global const float* restrict target,
                             global float* restrict m, global float* restrict d, int count) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float raw = pictures[i];
  const float x = raw < 0.0f ? 0.0f : raw > 1.0f ? 1.0f : raw;  // NaN stays
  m[i] = 0.5f * (x + target[i]) - 0.5f;
  d[i] = x - target[i];
}

// Halves both sides: means of 2 x 2. An odd side has a row of zeros of x and t before its first, as avg_pool2d pads.
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

// rows [4, N, H, V3]: m, d, m^2, d^2 blurred along x. y counts the rows of all pictures here.
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

// off [N, H - 10, V3]: 1 - SSIM, or 1 - cs where `structure`. slopes [3, N, H - 10, V3] (or null): its derivatives by
// M and D together as x moves them (half of the one and the whole of the other), by B m^2, and by B d^2.
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
  const float vm = smm - M * M, vd = sdd - D * D;
  const float by1 = 1.0f / (2.0f * (M + 0.5f) * (M + 0.5f) + 0.5f * D * D + 1e-4f);
  const float by2 = 1.0f / (2.0f * vm + 0.5f * vd + 9e-4f);
  const float off_l = structure ? 0.0f : D * D * by1, off_cs = vd * by2;
  const int valid = H - WINDOW + 1;
  const size_t to = ((size_t)n * valid + y) * V3 + j, step = (size_t)N * valid * V3;
  off[to] = off_l + off_cs - off_l * off_cs;
  if (!slopes) return;
  const float l = 1.0f - off_l, cs = 1.0f - off_cs;
  const float by_vm = -2.0f * off_cs * by2 * l, by_vd = (1.0f - 0.5f * off_cs) * by2 * l;
  const float by_M = structure ? 0.0f : -4.0f * off_l * by1 * (M + 0.5f) * cs;
  const float by_D = structure ? 0.0f : (2.0f - off_l) * D * by1 * cs;
  slopes[to] = 0.5f * (by_M - 2.0f * M * by_vm) + by_D - 2.0f * D * by_vd;
  slopes[to + step] = by_vm;
  slopes[to + 2 * step] = by_vd;
}

// The blur's transpose along y, from slopes to [3, N, H, V3 + 60], whose rows have 30 zeros at either end. n counts the
// pictures of all three.
kernel void loss_backward_spread(global const float* restrict slopes, global float* restrict spread, int V3, int H) {
  const int pad = 3 * (WINDOW - 1), valid = H - WINDOW + 1;
  const int j = get_global_id(0), y = get_global_id(1), n = get_global_id(2);
  if (j >= V3 + 2 * pad) return;
  float sum = 0.0f;
  if (j >= pad && j < V3 + pad) {
    const int first = max(0, y - valid + 1), last = min(WINDOW - 1, y);
    for (int k = first; k <= last; ++k) sum = FMA(window[k], slopes[((size_t)n * valid + y - k) * V3 + j - pad], sum);
  }
  spread[((size_t)n * H + y) * (V3 + 2 * pad) + j] = sum;
}

// dpictures [N, H, W3] at one scale: the transpose along x, by[first + 3 n + c] times the three together, and a quarter of that of
// the next coarser scale (null: none). At the finest scale `pictures` are those that were clamped: there, + error * d, and
// 0 where they are outside of [0, 1].
kernel void loss_backward(global const float* restrict spread, global const float* restrict m,
                          global const float* restrict d, global const float* restrict by,
                          global const float* restrict coarser, global const float* restrict pictures,
                          global float* restrict dpictures, int H, int W, int N, int first, float error) {
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
    sum = FMA(error, d[at], sum);
    if (pictures[at] < 0.0f || pictures[at] > 1.0f) sum = 0.0f;
  }
  dpictures[at] = sum;
}

// sums [N, blocks, 3]: of x [N, pixels, 3], or of its squares, over GROUP * EACH pixels each. Groups (blocks, N).
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void loss_sums(global const float* restrict x,
                                                                         global float* restrict sums, int pixels,
                                                                         int squares) {
  local float part[3][GROUP];
  const int block = get_group_id(0), n = get_group_id(1), item = get_local_id(0);
  global const float* from = x + ((size_t)n * pixels + (size_t)block * GROUP * EACH) * 3;
  const int left = min(pixels - block * (GROUP * EACH), GROUP * EACH);
  float sum[3] = {0.0f, 0.0f, 0.0f};
  for (int i = item; i < left; i += GROUP)
    for (int c = 0; c < 3; ++c) sum[c] += squares ? from[3 * i + c] * from[3 * i + c] : from[3 * i + c];
  for (int c = 0; c < 3; ++c) part[c][item] = sum[c];
  for (int step = GROUP / 2; step > 0; step /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < step)
      for (int c = 0; c < 3; ++c) part[c][item] += part[c][item + step];
  }
  if (item == 0)
    for (int c = 0; c < 3; ++c) sums[((size_t)n * get_num_groups(0) + block) * 3 + c] = part[c][0];
}

// means[first + i], i = 3 n + c, from those sums. A work-item each, planes = 3 N of them; Kahan's summation.
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

// From means [1 + scales, planes], of d^2 and then of `off` scale by scale: out [3] = loss, mean squared error, similarity, and
// by [scales, planes], what loss_backward takes, times gradient_scale. H and W are those of the pictures. One work-item.
// One scale: the mean of SSIM. Five: the mean over planes of the product of each scale's positive part to its power.
kernel void loss_value(global const float* restrict means, global float* restrict out, global float* restrict by, int H,
                       int W, int planes, int scales, float weight, float gradient_scale) {
  const float power[5] = {0.0448f, 0.2856f, 0.3001f, 0.2363f, 0.1333f};
  float error = 0.0f, off = 0.0f;
  for (int i = 0; i < planes; ++i) {
    error += means[i];
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
  out[2] = 1.0f - off / planes;
}
