// Gaussians from unconstrained parameters, and the gradient: a scene that is fitted to pictures is optimised in these.
// Means, quaternions and spherical harmonics are used as they are.
//   scale = exp(x)      opacity = min(1, raise * sigmoid(x)), or 0 where the Gaussian is left out of a step
// ```
// argument     type   shape  what
// log_scales   f32    [K,3]  x of the scales
// logits       f32    [K]    x of the opacities
// drop_below   uint          Gaussian k is left out where word 0 of its random number is below this; 0: none is
// draw         uint          which of the stream's draws: the counter is {k, draw, stream, 0}
// stream       uint
// key          uint x 2      of the seed
// raise        float         1 / (1 - share left out): the picture stays as bright on average (DropGaussian, Park et
//                            al. 2025)
// define BLOCK 256              Gaussians of a work-item in the cpu flavour, a multiple of 16
// work-items   cpu: one per BLOCK Gaussians; gpu: one per scale; the first K also handle an opacity each
// ```
#include "rng.clh"
#include "tile_cpu.clh"

#ifndef BLOCK
#define BLOCK 256
#endif

static inline bool is_kept(int k, uint drop_below, uint draw, uint stream, uint key0, uint key1) {
  return drop_below == 0u || philox4x32_10((uint4)(k, draw, stream, 0u), (uint2)(key0, key1)).x >= drop_below;
}

// ```
// argument   type   shape  what
// scales     f32    [K,3]  written
// opacities  f32    [K]    written
// ```
kernel void splat_parameters_forward_cpu(global const float* restrict log_scales, global const float* restrict logits,
                                         global float* restrict scales, global float* restrict opacities, int K,
                                         uint drop_below, uint draw, uint stream, uint key0, uint key1, float raise) {
  const int begin = get_global_id(0) * BLOCK, end = min(K, begin + BLOCK);
  for (int i = 3 * begin; i < 3 * end; i += 16)
    store_part(exp_16(load_part(log_scales + i, 3 * end - i)), 3 * end - i, scales + i);
  for (int k = begin; k < end; k += 16) {
    const float16 opacity = raise / (1.0f + exp_16(-load_part(logits + k, end - k)));
    store_part(opacity > 1.0f ? (float16)(1.0f) : opacity, end - k, opacities + k);
  }
  if (drop_below == 0u) return;
  for (int k = begin; k < end; ++k)
    if (!is_kept(k, drop_below, draw, stream, key0, key1)) opacities[k] = 0.0f;
}

kernel void splat_parameters_forward_gpu(global const float* restrict log_scales, global const float* restrict logits,
                                         global float* restrict scales, global float* restrict opacities, int K,
                                         uint drop_below, uint draw, uint stream, uint key0, uint key1, float raise) {
  const int k = get_global_id(0);
  if (k < 3 * K) scales[k] = exp(log_scales[k]);
  if (k >= K) return;
  const float opacity = raise * sigmoid(logits[k]);
  opacities[k] = is_kept(k, drop_below, draw, stream, key0, key1) ? (opacity > 1.0f ? 1.0f : opacity) : 0.0f;
}

// Gradients by scales and opacities become those by x, in place; the regularisers' are added:
//   opacity_weight sum sigmoid(x) + scale_weight sum exp(x) + pull / 2 (|mean - home|^2 + |x - home x|^2)
// ```
// argument        type   shape  what
// dmeans          f32    [K,3]  added to: the pull's gradient
// dscales         f32    [K,3]  in: by scales; out: by log_scales
// dopacities      f32    [K]    in: by opacities; out: by logits
// means           f32    [K,3]  means
// home_means      f32    [K,3]  centres of the pull; null: no pull
// home_scales     f32    [K,3]  log scales there; null if home_means is
// opacity_weight  float         of the sum of opacities
// scale_weight    float         of the sum of scales
// pull            float         of the squared distances
// ```
kernel void splat_parameters_backward_cpu(global const float* restrict log_scales, global const float* restrict logits,
                                          global const float* restrict means, global const float* restrict home_means,
                                          global const float* restrict home_scales, global float* restrict dmeans,
                                          global float* restrict dscales, global float* restrict dopacities, int K,
                                          uint drop_below, uint draw, uint stream, uint key0, uint key1, float raise,
                                          float opacity_weight, float scale_weight, float pull) {
  const int begin = get_global_id(0) * BLOCK, end = min(K, begin + BLOCK);
  for (int i = 3 * begin; i < 3 * end; i += 16) {
    const int n = 3 * end - i;
    const float16 x = load_part(log_scales + i, n);
    float16 d = (load_part(dscales + i, n) + scale_weight) * exp_16(x);
    if (home_means) {
      d = FMA(pull, x - load_part(home_scales + i, n), d);
      const float16 away = load_part(means + i, n) - load_part(home_means + i, n);
      store_part(FMA(pull, away, load_part(dmeans + i, n)), n, dmeans + i);
    }
    store_part(d, n, dscales + i);
  }
  if (drop_below != 0u)
    for (int k = begin; k < end; ++k)
      if (!is_kept(k, drop_below, draw, stream, key0, key1)) dopacities[k] = 0.0f;
  for (int k = begin; k < end; k += 16) {
    const float16 x = load_part(logits + k, end - k), opacity = 1.0f / (1.0f + exp_16(-x));
    const float16 d = load_part(dopacities + k, end - k);
    const float16 by = raise * opacity < 1.0f ? raise * d : (float16)(0.0f);
    // 1 - opacity, not rounded near 1.
    store_part((by + opacity_weight) * opacity * (1.0f / (1.0f + exp_16(x))), end - k, dopacities + k);
  }
}

kernel void splat_parameters_backward_gpu(global const float* restrict log_scales, global const float* restrict logits,
                                          global const float* restrict means, global const float* restrict home_means,
                                          global const float* restrict home_scales, global float* restrict dmeans,
                                          global float* restrict dscales, global float* restrict dopacities, int K,
                                          uint drop_below, uint draw, uint stream, uint key0, uint key1, float raise,
                                          float opacity_weight, float scale_weight, float pull) {
  const int k = get_global_id(0);
  if (k < 3 * K) {
    float d = (dscales[k] + scale_weight) * exp(log_scales[k]);
    if (home_means) {
      d = FMA(pull, log_scales[k] - home_scales[k], d);
      dmeans[k] = FMA(pull, means[k] - home_means[k], dmeans[k]);
    }
    dscales[k] = d;
  }
  if (k >= K) return;
  const float opacity = sigmoid(logits[k]);
  const bool moves = raise * opacity < 1.0f && is_kept(k, drop_below, draw, stream, key0, key1);
  const float slope = opacity * sigmoid(-logits[k]);  // 1 - opacity, not rounded near 1
  dopacities[k] = ((moves ? raise * dopacities[k] : 0.0f) + opacity_weight) * slope;
}
