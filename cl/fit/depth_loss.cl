// A loss on a picture's expected depth, e = depth / alpha, and its slopes: for each pixel with a given depth
//   loss = slope (alpha' |log e - log want| + 1 - alpha), with alpha' = alpha held constant
// so that an error of a tenth weighs as much far away as nearby, and what is seen is opaque. What is wanted follows
// from what is given, m:
//   kind 0  metric    want = m
//   kind 1  relative  want = a (m - 1/2) + b          a and b fit e best, by least squares weighted with alpha
//   kind 2  inverse   want = 1 / (a (m - 1/2) + b)    a and b fit 1 / e best, likewise
// ```
// argument  type   shape  what
// depth     f32    [P]    drawn: sum of weight x camera z
// alpha     f32    [P]    drawn
// given     f32    [P]    m; 0: unknown
// ```
#include "common.clh"

#define LEAST_ALPHA (1.0f / 255.0f)

// The sums from which a and b follow, over each row of pixels.
// ```
// argument    type  shape  what
// sums        f32   [H,5]  written: of w = alpha, w x, w x^2, w y and w x y, where x = m - 1/2 and y = e or 1 / e
// inverse     int          1: y = 1 / e
// work-items  one per row
// ```
kernel void depth_loss_sums(global const float* restrict depth, global const float* restrict alpha,
                            global const float* restrict given, global float* restrict sums, int H, int W,
                            int inverse) {
  const int row = get_global_id(0);
  if (row >= H) return;
  float weights = 0.0f;
  float4 moments = (float4)(0.0f);
  for (size_t i = (size_t)row * W; i < (size_t)(row + 1) * W; ++i) {
    const float w = alpha[i], z = depth[i], m = given[i];
    if (!(m > 0.0f && w > LEAST_ALPHA && z > 0.0f)) continue;
    const float x = m - 0.5f, y = inverse ? w / z : z / w;
    weights += w;
    moments += w * (float4)(x, x * x, y, x * y);
  }
  sums[5 * row] = weights;
  vstore4(moments, 0, sums + 5 * row + 1);
}

// ```
// argument    type   shape  what
// sums        f32    [5]    over all rows; null: metric
// ddepth      f32    [P]    written
// dalpha      f32    [P]    added to
// inverse     int           1: inverse, else relative
// slope       float         of the loss: the weight over the number of pixels with a given depth
// work-items  one per pixel
// ```
// Without slopes where alpha is below LEAST_ALPHA, where `want` is not above 0, and in the whole picture if what is
// given does not grow with what is drawn.
kernel void depth_loss(global const float* restrict depth, global const float* restrict alpha,
                       global const float* restrict given, global const float* restrict sums,
                       global float* restrict ddepth, global float* restrict dalpha, int P, int inverse, float slope) {
  const int i = get_global_id(0);
  if (i >= P) return;
  const float w = alpha[i], z = depth[i], m = given[i];
  float want = m;
  if (sums) {
    const float n = sums[0], x = sums[1] / n, y = sums[3] / n;
    const float spread = sums[2] / n - x * x, a = (sums[4] / n - x * y) / spread;
    const float fitted = FMA(a, m - 0.5f - x, y);
    want = spread > 1e-6f && a > 0.0f && fitted > 0.0f ? (inverse ? 1.0f / fitted : fitted) : 0.0f;
  }
  const bool counts = m > 0.0f && w > LEAST_ALPHA && z > 0.0f && want > 0.0f;
  const float off = z - want * w, by = off > 0.0f ? slope : off < 0.0f ? -slope : 0.0f;
  ddepth[i] = counts ? by * w / z : 0.0f;
  if (counts) dalpha[i] -= by + slope;
}
