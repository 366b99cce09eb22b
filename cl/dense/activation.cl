// GELU (exact, or by tanh), SiLU and ReLU as separate operations, for inputs that the backward needs, and their
// derivatives.
// ```
// argument      type  shape  what
// x             f32   [N]    input
// out           f32   [N]    written: act(x); may be x
// dy            f32   [N]    backward: gradient of out
// dx            f32   [N]    backward, written: dy act'(x); may be dy
// act           int          1 GELU, 2 SiLU, 3 ReLU, 4 GELU by tanh
// define BLOCK  1024         elements of a work-item in the cpu flavour
// work-items    cpu: one per BLOCK elements; gpu: one per element
// ```
#include "tile_cpu.clh"

#ifndef BLOCK
#define BLOCK 1024
#endif

#define SQRT_HALF 0.70710678118654752f
#define SQRT_TWO_PI_INVERSE 0.39894228040143268f
#define SQRT_8_BY_PI 1.59576912160573071f

// act'(x). GELU: the normal distribution's cumulative function, plus x times its density. SiLU: s (1 + x (1 - s)), s =
// sigmoid(x). GELU by tanh: s + x (e s) s 2 u', s = sigmoid(2 u), with e =
// exp(-2 u), since 1 - s would cancel. x is clamped to [-40, 40]: beyond that both derivatives are 0 or 1 in float,
// but exp_16 never returns 0, and a large x would magnify its value.
static inline float16 slope_16(float16 v, int act) {
  if (act == 3) return select((float16)(0.0f), (float16)(1.0f), v > 0.0f);
  const float16 x = clamp(v, -40.0f, 40.0f);
  if (act == 1) return 0.5f * (1.0f + erf_16(x * SQRT_HALF)) + x * SQRT_TWO_PI_INVERSE * exp_16(-0.5f * x * x);
  if (act == 4) {
    const float16 e = exp_16(-SQRT_8_BY_PI * (x + 0.044715f * x * x * x)), s = 1.0f / (1.0f + e);
    return s + x * (e * s) * s * SQRT_8_BY_PI * (1.0f + 0.134145f * x * x);
  }
  const float16 s = 1.0f / (1.0f + exp_16(-x));
  return s * (1.0f + x * (1.0f - s));
}

static inline float slope(float x, int act) {
  if (act == 3) return x > 0.0f ? 1.0f : 0.0f;
  if (act == 1) return 0.5f * (1.0f + erf(x * SQRT_HALF)) + x * SQRT_TWO_PI_INVERSE * exp(-0.5f * x * x);
  if (act == 4) {
    const float v = clamp(x, -40.0f, 40.0f);
    const float e = exp(min(80.0f, -SQRT_8_BY_PI * (v + 0.044715f * v * v * v))), s = 1.0f / (1.0f + e);
    return s + v * (e * s) * s * SQRT_8_BY_PI * (1.0f + 0.134145f * v * v);
  }
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
