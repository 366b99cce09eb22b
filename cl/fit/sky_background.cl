// A sky behind a picture: spherical harmonics of degree 4 over directions, seen where transmittance is left.
//   out = colour + (1 - alpha) sky(d)      sky(d) = 0.5 + sum over k of basis_k(d) sh_k
// d is the direction of the pixel's centre in the scene's frame. The basis continues that of 3DGS files, in their order
// and with their signs. The sky is not clamped, so every coefficient has a gradient everywhere. These kernels are for
// GPUs; sky_background_cpu.cl has them by rows.
// ```
// argument      type   shape   what
// sh            f32    [25,3]  the sky's coefficients
// camera        f32    [32]    the camera's numbers, see project.cl
// alpha         f32    [P]     drawn
// W             int            pixels of a row
// ```
#include "sky_background.clh"

#define BLOCK 256  // pixels of a work-item in the backward

// The direction of pixel `i`, of length 1.
static inline float3 direction_of(global const float* restrict camera, int i, int W) {
  const float x = ((float)(i % W) + 0.5f - camera[17]) / camera[15];
  const float y = ((float)(i / W) + 0.5f - camera[18]) / camera[16];
  const float3 d = x * vload3(0, camera) + y * vload3(1, camera) + vload3(2, camera);
  return d * rsqrt(dot(d, d));
}

DEFINE_SKY_BASIS(float)

static inline float3 sky_at(global const float* restrict sh, float3 d) {
  float basis[BASIS];
  sky_basis_float(d.x, d.y, d.z, basis);
  float3 sum = 0.5f;
#pragma unroll
  for (int k = 0; k < BASIS; ++k) sum += basis[k] * vload3(k, sh);
  return sum;
}

// ```
// argument    type  shape  what
// colour      f32   [P,3]  drawn over black
// out         f32   [P,3]  written
// work-items  one per pixel
// ```
kernel void sky_background_forward(global const float* restrict sh, global const float* restrict camera,
                                   global const float* restrict colour, global const float* restrict alpha,
                                   global float* restrict out, int W, int P) {
  const int i = get_global_id(0);
  if (i >= P) return;
  vstore3(vload3(i, colour) + (1.0f - alpha[i]) * sky_at(sh, direction_of(camera, i, W)), i, out);
}

// The gradient by alpha. That by the drawn colour is that by `out`.
// ```
// argument    type  shape  what
// dout        f32   [P,3]  by out
// dalpha      f32   [P]    added to
// work-items  one per pixel
// ```
kernel void sky_background_backward_alpha(global const float* restrict sh, global const float* restrict camera,
                                          global const float* restrict dout, global float* restrict dalpha, int W,
                                          int P) {
  const int i = get_global_id(0);
  if (i >= P) return;
  dalpha[i] -= dot(vload3(i, dout), sky_at(sh, direction_of(camera, i, W)));
}

// The gradient by the coefficients, a block's part of it.
// ```
// argument    type  shape           what
// dout        f32   [P,3]           by out
// rows        f32   [blocks,25,3]   written
// work-items  (block of BLOCK pixels, channel)
// ```
kernel void sky_background_backward_sh(global const float* restrict camera, global const float* restrict alpha,
                                       global const float* restrict dout, global float* restrict rows, int W, int P) {
  const int block = get_global_id(0), channel = get_global_id(1), begin = block * BLOCK;
  if (begin >= P) return;
  float sums[BASIS], basis[BASIS];
#pragma unroll
  for (int k = 0; k < BASIS; ++k) sums[k] = 0.0f;
  for (int i = begin; i < min(P, begin + BLOCK); ++i) {
    const float by = (1.0f - alpha[i]) * dout[3 * i + channel];
    const float3 d = direction_of(camera, i, W);
    sky_basis_float(d.x, d.y, d.z, basis);
#pragma unroll
    for (int k = 0; k < BASIS; ++k) sums[k] += basis[k] * by;
  }
#pragma unroll
  for (int k = 0; k < BASIS; ++k) rows[(block * BASIS + k) * 3 + channel] = sums[k];
}
