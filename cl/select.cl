// Which voxels are refined, and by how much every coarse opacity counts.   (f32; a work-item per voxel)
//   logits, noise, opacities, factor, refined [n]   flags [n] (u32, 0 or 1)
//   variant 1 gumbel   factor = sigmoid((logit + noise) / temperature), flag = factor > 0.5; noise may be null
//           2 sigmoid  factor = sigmoid(logit), flag = factor > 0.5
//           3 ste      factor = flag = sigmoid(logit) > 0.5
//           4 opacity  factor = 1, flag = opacity > threshold
//   refined = opacity * factor
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
  factor[i] = value;
  refined[i] = opacities[i] * value;
  flags[i] = chosen ? 1u : 0u;
}

// Backward: drefined is the loss by refined; dlogits [n] (may be null) and dopacities are written; dopacities may be drefined.
// Variant 3's factor has its own derivative taken for that of sigmoid(logit); variant 4 has none by the logit.
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

// The difference of two Gumbel variables, which is logistic: log(u) - log(1 - u) with u of counter {voxel, step, stream, 0}.
kernel void select_noise(global float* restrict noise, int n, uint step, uint stream, uint key_low, uint key_high) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float u = uniform_open(philox4x32_10((uint4)((uint)i, step, stream, 0u), (uint2)(key_low, key_high)).x);
  noise[i] = log(u) - log(1.0f - u);
}
