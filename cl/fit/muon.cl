// The elementwise parts of Muon (Jordan et al. 2024); the products of matrices between them are GEMMs.
#include "common.clh"

// The moving average of the gradient, and Nesterov's look-ahead. The latter is the input of the orthogonalisation: a
// matrix with at most as many columns as rows.
//   m += (1 - momentum) (g - m)   out = (1 - momentum) g + momentum m
// ```
// argument    type   shape          what
// grad        f32    [n,k]          gradient as stored
// clip        f32    [2]            from adamw_clip, clip[1] is the factor; null: 1
// m           f32    [n,k]          in place
// out         f32    [n,k] / [k,n]  written; transposed if `turned` is not 0
// fresh       float                 1 - momentum
// work-items  one per element
// ```
kernel void muon_momentum(global const float* restrict grad, global const float* restrict clip,
                          global float* restrict m, global float* restrict out, int n, int k, int turned,
                          float momentum, float fresh) {
  const int i = get_global_id(0);
  if (i >= n * k) return;
  const float g = grad[i] * (clip ? clip[1] : 1.0f);
  const float mean = FMA(fresh, g - m[i], m[i]);
  m[i] = mean;
  out[turned ? i % k * n + i / k : i] = FMA(momentum, mean, fresh * g);
}

// ```
// argument    type  shape    what
// x           f32   [count]  in place: divided by its norm
// norm        f32   [2]      from adamw_clip, norm[0] is the norm of x; 0: x becomes 0
// work-items  one per element
// ```
kernel void muon_normalize(global float* restrict x, global const float* restrict norm, int count) {
  const int i = get_global_id(0);
  if (i < count) x[i] = norm[0] == 0.0f ? 0.0f : x[i] / norm[0];  // squares of tiny numbers underflow to 0
}

// p = a I + b s + c s^2 for a square matrix s.
// ```
// argument    type  shape  what
// s, s2       f32   [k,k]  a matrix and its square
// p           f32   [k,k]  written
// work-items  one per element
// ```
kernel void muon_polynomial(global const float* restrict s, global const float* restrict s2, global float* restrict p,
                            int k, float a, float b, float c) {
  const int i = get_global_id(0);
  if (i >= k * k) return;
  p[i] = FMA(b, s[i], FMA(c, s2[i], i / k == i % k ? a : 0.0f));
}

// param -= decay param + rate x
// ```
// argument    type   shape          what
// param       f32    [n,k]          in place
// x           f32    [n,k] / [k,n]  transposed if `turned` is not 0
// decay       float                 learning rate times weight decay
// work-items  one per element
// ```
kernel void muon_update(global float* restrict param, global const float* restrict x, int n, int k, int turned,
                        float decay, float rate) {
  const int i = get_global_id(0);
  if (i >= n * k) return;
  param[i] -= FMA(decay, param[i], rate * x[turned ? i % k * n + i / k : i]);
}
