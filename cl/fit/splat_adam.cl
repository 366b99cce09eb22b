// A step of Adam (Kingma and Ba 2015) on one kind of parameter of all Gaussians, which clears the gradient:
//   m += (1 - beta1) (g - m)   v += (1 - beta2) (g^2 - v)   param -= rate m / (root sqrt(v) + eps)
// ```
// argument      type   shape   what
// param, m, v   f32    [n]     in place: the parameters of each Gaussian, width of them, and their moments
// grad          f32    [n]     gradient; zeros afterwards
// width         int            parameters of a Gaussian
// head          int            how many of them, from the first, have the learning rate `rate`
// rate, rest    float          learning rates / (1 - beta1^t), t: the number of the step from 1
// new1, new2    float          1 - beta1, 1 - beta2
// root          float          1 / sqrt(1 - beta2^t)
// low, high     float          parameters are clamped to this range; infinite: not
// sparse        int            1: nothing changes where the gradient is 0, not even the moments
// define BLOCK  1024           elements of a work-item in the cpu flavour, a multiple of 16
// work-items    cpu: one per BLOCK elements; gpu: one per element
// ```
// The cpu flavour skips 16 parameters without a gradient: in a closed scene each picture leaves out half of them.
#include "common.clh"
#include "vector16.clh"

#ifndef BLOCK
#define BLOCK 1024
#endif

kernel void splat_adam_cpu(global float* restrict param, global float* restrict grad, global float* restrict m,
                           global float* restrict v, int n, int width, int head, float rate, float rest, float new1,
                           float new2, float eps, float root, float low, float high, int sparse) {
  const int begin = get_global_id(0) * BLOCK, end = min(n, begin + BLOCK), ahead = 16 % width;
  int16 column = (begin + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)) % width;
  for (int i = begin; i < end; i += 16, column += ahead, column -= width & (column >= width)) {
    const float16 g = load_part(grad + i, n - i);
    const int16 touched = sparse ? g != 0.0f : (int16)(-1);
    if (!any(touched)) continue;
    const float16 old1 = load_part(m + i, n - i), old2 = load_part(v + i, n - i), old = load_part(param + i, n - i);
    const float16 first = FMA(new1, g - old1, old1), second = FMA(new2, g * g - old2, old2);
    const float16 rates = column < head ? (float16)(rate) : (float16)(rest);
    const float16 moved = old - rates * first / FMA(root, sqrt(second), eps);
    const float16 held = moved < low ? (float16)(low) : moved > high ? (float16)(high) : moved;
    store_part((float16)(0.0f), n - i, grad + i);
    store_part(select(old1, first, touched), n - i, m + i);
    store_part(select(old2, second, touched), n - i, v + i);
    store_part(select(old, held, touched), n - i, param + i);
  }
}

kernel void splat_adam_gpu(global float* restrict param, global float* restrict grad, global float* restrict m,
                           global float* restrict v, int n, int width, int head, float rate, float rest, float new1,
                           float new2, float eps, float root, float low, float high, int sparse) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float g = grad[i];
  if (sparse && g == 0.0f) return;
  const float first = FMA(new1, g - m[i], m[i]);
  const float second = FMA(new2, g * g - v[i], v[i]);
  const float moved = param[i] - (i % width < head ? rate : rest) * first / FMA(root, sqrt(second), eps);
  grad[i] = 0.0f;
  m[i] = first;
  v[i] = second;
  param[i] = moved < low ? low : moved > high ? high : moved;
}
