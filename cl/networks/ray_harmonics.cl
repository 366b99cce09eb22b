// Converts rays of six numbers, a direction and a moment of any length, to the numbers that the network reads.
// ```
// argument    type  shape   what
// rays        f32   [R,6]   direction, moment
// out         f32   [R,32]  written: 16 numbers of the direction, 16 of the moment (plucker.clh)
// work-items  one per (direction or moment, ray): 2 R
// ```
#include "plucker.clh"

kernel void ray_harmonics_forward(global const float* rays, global float* out, int R) {
  const int i = get_global_id(0);
  if (i < 2 * R) real_sh3(vload3(i, rays), out + (size_t)i * 16);
}

// Backward.
// ```
// dout        f32   [R,32]  gradient of out
// drays       f32   [R,6]   written
// work-items  as in the forward
// ```
kernel void ray_harmonics_backward(global const float* rays, global const float* dout, global float* drays, int R) {
  const int i = get_global_id(0);
  if (i < 2 * R) vstore3(real_sh3_backward(vload3(i, rays), dout + (size_t)i * 16), i, drays);
}
