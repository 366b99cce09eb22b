// Selects the voxels to refine, and weights the coarse opacity of each. The variants:
//   1 gumbel            factor = sigmoid((logit + noise) / temperature), flag = factor > 0.5
//   2 sigmoid           factor = sigmoid(logit), flag = factor > 0.5
//   3 straight-through  factor = flag = sigmoid(logit) > 0.5
//   4 opacity           factor = 1, flag = opacity > threshold
// ```
// argument    type  shape  what
// logits      f32   [n]    the network's vote for each voxel; null in variant 4
// noise       f32   [n]    added to the logits in variant 1; null: none
// opacities   f32   [n]    opacities of the coarse Gaussians
// factor      f32   [n]    written: see the variants; null: not written
// refined     f32   [n]    written: opacity * factor; null: not written
// flags       u32   [n]    written: 1 if the voxel is refined, else 0
// variant     int          1 to 4
// work-items  one per voxel
// ```
#include "common.clh"
#include "rng.clh"

kernel void select_forward(global const float* restrict logits, global const float* restrict noise,
                           global const float* restrict opacities, global float* restrict factor,
                           global float* restrict refined, global uint* restrict flags, int n, int variant,
                           float temperature, float threshold) {
  const int i = get_global_id(0);
  if (i >= n) return;
  float value = 1.0f;
  bool chosen = opacities[i] > threshold;
  if (variant != 4) {
    float x = logits[i];
    if (variant == 1) x = (noise ? x + noise[i] : x) / temperature;
    value = sigmoid(x);
    chosen = value > 0.5f;
    if (variant == 3) value = chosen ? 1.0f : 0.0f;
  }
  if (factor) factor[i] = value;
  if (refined) refined[i] = opacities[i] * value;
  flags[i] = chosen ? 1u : 0u;
}

// Backward. The derivative of variant 3's factor is that of sigmoid(logit); variant 4 has none by the logit.
// ```
// argument    type  shape  what
// drefined    f32   [n]    gradient of refined
// dlogits     f32   [n]    written; null: not written
// dopacities  f32   [n]    written; may be drefined
// work-items  one per voxel
// ```
kernel void select_backward(global const float* restrict logits, global const float* restrict noise,
                            global const float* restrict opacities, global const float* drefined,
                            global float* restrict dlogits, global float* dopacities, int n, int variant,
                            float temperature) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float d = drefined[i];
  float factor = 1.0f, slope = 0.0f;
  if (variant != 4) {
    float x = logits[i];
    if (variant == 1) x = (noise ? x + noise[i] : x) / temperature;
    factor = sigmoid(x);
    slope = factor * sigmoid(-x);
    if (variant == 1) slope /= temperature;
    if (variant == 3) factor = factor > 0.5f ? 1.0f : 0.0f;
  }
  if (dlogits) dlogits[i] = d * opacities[i] * slope;
  dopacities[i] = d * factor;
}

// Noise for variant 1: the difference of two Gumbel variables, which is logistic, log(u) - log(1 - u), where u is a
// random number of the counter {voxel, step, stream, 0}.
// ```
// argument           type  shape  what
// noise              f32   [n]    written
// key_low, key_high  u32          the halves of the seed
// work-items         one per voxel
// ```
kernel void select_noise(global float* restrict noise, int n, uint step, uint stream, uint key_low, uint key_high) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float u = uniform_open(philox4x32_10((uint4)((uint)i, step, stream, 0u), (uint2)(key_low, key_high)).x);
  noise[i] = log(u) - log(1.0f - u);
}
