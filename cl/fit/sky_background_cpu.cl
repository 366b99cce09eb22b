// The sky of sky_background.cl on a CPU: a work-item processes a row of the picture, 16 pixels at a time.
#include "sky_background.clh"
#include "vector16.clh"

DEFINE_SKY_BASIS(float16)

// The basis in the directions of 16 pixels, from column x of row y on.
static inline void basis_at(global const float* restrict camera, int x, int y, float16* basis) {
  const float16 columns = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + ((float)x + 0.5f);
  const float16 right = (columns - camera[17]) / camera[15];
  const float down = ((float)y + 0.5f - camera[18]) / camera[16];
  const float16 dx = right * camera[0] + (down * camera[3] + camera[6]);
  const float16 dy = right * camera[1] + (down * camera[4] + camera[7]);
  const float16 dz = right * camera[2] + (down * camera[5] + camera[8]);
  const float16 scale = 1.0f / sqrt(dx * dx + dy * dy + dz * dz);
  sky_basis_float16(scale * dx, scale * dy, scale * dz, basis);
}

// A channel of the sky there.
static inline float16 channel_of(const float16* basis, global const float* restrict sh, int channel) {
  float16 sum = 0.5f;
#pragma unroll
  for (int k = 0; k < BASIS; ++k) sum = FMA(basis[k], sh[3 * k + channel], sum);
  return sum;
}

// ```
// arguments   as in sky_background.cl, but H rows of W pixels
// work-items  one per row
// ```
kernel void sky_background_forward(global const float* restrict sh, global const float* restrict camera,
                                   global const float* restrict colour, global const float* restrict alpha,
                                   global float* restrict out, int W, int H) {
  const int y = get_global_id(0);
  if (y >= H) return;
  float16 basis[BASIS];
  float seen[3][16];
  alpha += (size_t)y * W;
  colour += (size_t)y * 3 * W;
  out += (size_t)y * 3 * W;
  for (int x = 0; x < W; x += 16) {
    const float16 through = 1.0f - load_part(alpha + x, W - x);
    basis_at(camera, x, y, basis);
    for (int c = 0; c < 3; ++c) vstore16(through * channel_of(basis, sh, c), 0, seen[c]);
    const int pixels = min(W - x, 16);
    for (int i = 0; i < pixels; ++i)
      for (int c = 0; c < 3; ++c) out[3 * (x + i) + c] = colour[3 * (x + i) + c] + seen[c][i];
  }
}

// The gradients by alpha and by the coefficients.
// ```
// argument    type  shape     what
// dout        f32   [P,3]     by out
// dalpha      f32   [P]       added to
// rows        f32   [H,25,3]  written: the gradient by the coefficients, a row's part of it
// work-items  one per row
// ```
kernel void sky_background_backward(global const float* restrict sh, global const float* restrict camera,
                                    global const float* restrict alpha, global const float* restrict dout,
                                    global float* restrict dalpha, global float* restrict rows, int W, int H) {
  const int y = get_global_id(0);
  if (y >= H) return;
  float16 basis[BASIS], sums[3 * BASIS];
  float by[3][16];
  for (int k = 0; k < 3 * BASIS; ++k) sums[k] = 0.0f;
  alpha += (size_t)y * W;
  dalpha += (size_t)y * W;
  dout += (size_t)y * 3 * W;
  rows += (size_t)y * 3 * BASIS;
  for (int x = 0; x < W; x += 16) {
    const int pixels = min(W - x, 16);
    for (int c = 0; c < 3; ++c) vstore16((float16)(0.0f), 0, by[c]);
    for (int i = 0; i < pixels; ++i)
      for (int c = 0; c < 3; ++c) by[c][i] = dout[3 * (x + i) + c];
    basis_at(camera, x, y, basis);
    const float16 through = 1.0f - load_part(alpha + x, W - x);
    float16 moved = load_part(dalpha + x, W - x);
    for (int c = 0; c < 3; ++c) {
      const float16 d = vload16(0, by[c]), seen = through * d;
      moved -= d * channel_of(basis, sh, c);
#pragma unroll
      for (int k = 0; k < BASIS; ++k) sums[BASIS * c + k] = FMA(basis[k], seen, sums[BASIS * c + k]);
    }
    store_part(moved, W - x, dalpha + x);
  }
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < BASIS; ++k) rows[3 * k + c] = sum_of(sums[BASIS * c + k]);
}
