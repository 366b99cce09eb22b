// A step of Adam (Kingma and Ba 2015) on one kind of parameter of all Gaussians, which clears the gradient:
//   m += (1 - beta1) (g - m)   v += (1 - beta2) (g^2 - v)   param -= rate m / (root sqrt(v) + eps)
// ```
// argument     type   shape  what
// param, m, v  f32    [n]    in place: the parameters of each Gaussian, width of them, and their moments
// grad         f32    [n]    gradient; zeros afterwards
// width, head  int           of a Gaussian's parameters the first `head` have `rate`, the others `rate_rest`
// new1, new2   float         1 - beta1, 1 - beta2
// rate         float         learning rate / (1 - beta1^t), t: the number of the step from 1
// root         float         1 / sqrt(1 - beta2^t)
// low, high    float         parameters are held within; infinite: not
// work-items   one per parameter
// ```
#include "common.clh"

kernel void splat_adam(global float* restrict param, global float* restrict grad, global float* restrict m,
                       global float* restrict v, int n, int width, int head, float new1, float new2, float eps,
                       float rate, float rate_rest, float root, float low, float high) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float g = grad[i];
  const float first = FMA(new1, g - m[i], m[i]);
  const float second = FMA(new2, g * g - v[i], v[i]);
  const float by = head == width || i % width < head ? rate : rate_rest;
  grad[i] = 0.0f;
  m[i] = first;
  v[i] = second;
  const float moved = param[i] - by * first / FMA(root, sqrt(second), eps);
  param[i] = moved < low ? low : moved > high ? high : moved;
}
