// Applies a camera's exposure and colour balance to a picture: an affine map of the object's colours. The object's
// share of a pixel that is drawn over a background is alpha.
//   object = colour - (1 - alpha) background      out = A object + alpha b + (1 - alpha) background
// ```
// argument      type   shape   what
// map           f32    [12]    A row by row, then b
// colour        f32    [P,3]   drawn over the background
// alpha         f32    [P]     drawn
// b0, b1, b2    float          the background
// ```
#include "common.clh"

#define BLOCK 256  // pixels of a work-item in the backward

static inline float3 mapped(global const float* restrict map, float3 x) {
  return (float3)(dot(vload3(0, map), x), dot(vload3(1, map), x), dot(vload3(2, map), x));
}

// ```
// argument    type  shape  what
// out         f32   [P,3]  written
// work-items  one per pixel
// ```
kernel void exposure_forward(global const float* restrict map, global const float* restrict colour,
                             global const float* restrict alpha, global float* restrict out, int P, float b0, float b1,
                             float b2) {
  const int i = get_global_id(0);
  if (i >= P) return;
  const float3 behind = (1.0f - alpha[i]) * (float3)(b0, b1, b2);
  vstore3(mapped(map, vload3(i, colour) - behind) + alpha[i] * vload3(3, map) + behind, i, out);
}

// ```
// argument    type  shape        what
// dcolour     f32   [P,3]        in: by out; out: by colour
// dalpha      f32   [P]          added to; null: not written
// rows        f32   [blocks,12]  written: a block's part of the gradient by the map
// work-items  one per block of BLOCK pixels
// ```
kernel void exposure_backward(global const float* restrict map, global const float* restrict colour,
                              global const float* restrict alpha, global float* restrict dcolour,
                              global float* restrict dalpha, global float* restrict rows, int P, float b0, float b1,
                              float b2) {
  const int block = get_global_id(0), begin = block * BLOCK;
  if (begin >= P) return;
  const float3 background = (float3)(b0, b1, b2), a0 = vload3(0, map), a1 = vload3(1, map), a2 = vload3(2, map);
  float3 by0 = 0.0f, by1 = 0.0f, by2 = 0.0f, by_b = 0.0f;
  for (int i = begin; i < min(P, begin + BLOCK); ++i) {
    const float3 d = vload3(i, dcolour), object = vload3(i, colour) - (1.0f - alpha[i]) * background;
    by0 += d.x * object;
    by1 += d.y * object;
    by2 += d.z * object;
    by_b += alpha[i] * d;
    const float3 back = d.x * a0 + d.y * a1 + d.z * a2;
    vstore3(back, i, dcolour);
    if (dalpha) dalpha[i] += dot(d, vload3(3, map)) + dot(back - d, background);
  }
  vstore3(by0, 4 * block, rows);
  vstore3(by1, 4 * block + 1, rows);
  vstore3(by2, 4 * block + 2, rows);
  vstore3(by_b, 4 * block + 3, rows);
}
