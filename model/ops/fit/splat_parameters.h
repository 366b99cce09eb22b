// Gaussians from unconstrained parameters, and the derivative: a scene that is fitted to pictures is optimised in
// these.
#pragma once
#include <cstdint>

#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

// Means, quaternions and spherical harmonics are used as they are; scale = exp(log scale), opacity = sigmoid(logit).
struct SplatParameters {
  Tensor means;       // f32 [K,3]
  Tensor log_scales;  // f32 [K,3]
  Tensor quats;       // f32 [K,4], of any length but 0
  Tensor logits;      // f32 [K]
  Tensor sh;          // f32 [K,S,3]

  long count() const { return means ? means.dim(0) : 0; }
};

// Leaves Gaussians out of a step at random, by the seed: each with this probability. The opacities of the others are
// divided by the share that is kept, up to 1.
struct Dropping {
  float share = 0;  // below 1
  std::uint64_t seed = 0;
  std::uint32_t draw = 0;
};

struct SplatParametersForward {
  SplatParameters x;
  Dropping dropping;
  Tensor scales;     // f32 [K,3], written
  Tensor opacities;  // f32 [K], written: 0 if the Gaussian is left out
};
void splat_parameters_forward(Context& ctx, const SplatParametersForward& a);

// Turns gradients by scales and opacities into those by log scales and logits, in place, and adds those of the
// regularisers: opacity_weight sum opacity + scale_weight sum scale + pull / 2 (|mean - home mean|^2 + |log scale -
// home's|^2)
struct SplatParametersBackward {
  SplatParameters x;
  Dropping dropping;
  GaussianGradients dgaussians;
  float opacity_weight = 0, scale_weight = 0, pull = 0;
  Tensor home_means = {}, home_scales = {};  // f32 [K,3], both or none: no pull
};
void splat_parameters_backward(Context& ctx, const SplatParametersBackward& a);

}  // namespace vsplat
