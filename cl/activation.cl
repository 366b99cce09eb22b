// GELU (exact) and SiLU by themselves, where the input is kept for the backward, and their derivatives. act: 1 GELU, 2 SiLU.
//   x, out, dy, dx [N]; out may be x, dx may be dy.   out = act(x)   dx = dy act'(x)
// _cpu: a work-item per BLOCK elements, float16. _gpu: a work-item per element.
#include "tile_cpu.clh"

#ifndef BLOCK
#define BLOCK 1024
#endif

#define SQRT_HALF 0.70710678118654752f
#define SQRT_TWO_PI_INVERSE 0.39894228040143268f

// GELU: the normal distribution's cumulative function, and x times its density. SiLU with s = sigmoid(x): s (1 + x (1 - s)).
// Beyond 40 either is 0 or 1 in float; exp_16 is never 0, and times a large x not small.
static inline float16 slope_16(float16 v, int act) {
  const float16 x = clamp(v, -40.0f, 40.0f);
  if (act == 1) return 0.5f * (1.0f + erf_16(x * SQRT_HALF)) + x * SQRT_TWO_PI_INVERSE * exp_16(-0.5f * x * x);
  const float16 s = 1.0f / (1.0f + exp_16(-x));
  return s * (1.0f + x * (1.0f - s));
}

static inline float slope(float x, int act) {
  if (act == 1) return 0.5f * (1.0f + erf(x * SQRT_HALF)) + x * SQRT_TWO_PI_INVERSE * exp(-0.5f * x * x);
  const float s = sigmoid(x);
  return s * (1.0f + x * (1.0f - s));
}

kernel void activation_forward_cpu(global const float* x, global float* out, int N, int act) {
  const int begin = get_global_id(0) * BLOCK;
  for (int i = begin; i < min(N, begin + BLOCK); i += 16)
    store_part(activate_16(load_part(x + i, N - i), act), N - i, out + i);
}

kernel void activation_backward_cpu(global const float* x, global const float* dy, global float* dx, int N, int act) {
  const int begin = get_global_id(0) * BLOCK;
  for (int i = begin; i < min(N, begin + BLOCK); i += 16)
    store_part(load_part(dy + i, N - i) * slope_16(load_part(x + i, N - i), act), N - i, dx + i);
}

kernel void activation_forward_gpu(global const float* x, global float* out, int N, int act) {
  const int i = get_global_id(0);
  if (i < N) out[i] = activate(x[i], act);
}

kernel void activation_backward_gpu(global const float* x, global const float* dy, global float* dx, int N, int act) {
  const int i = get_global_id(0);
  if (i < N) dx[i] = dy[i] * slope(x[i], act);
}
