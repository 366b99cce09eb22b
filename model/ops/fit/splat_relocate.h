// Moves nearly transparent Gaussians to the places of others, adds new ones there, and lets barely visible ones wander:
// 3D Gaussian splatting as Markov chain Monte Carlo (Kheradmand et al. 2024); see cl/fit/splat_relocate.cl.
#pragma once
#include <cstdint>

#include "model/ops/fit/splat_parameters.h"

namespace vsplat {

// Parameters and moments, in memory for more Gaussians than there are.
struct SplatState {
  SplatParameters x, m, v;
};
// The first `count` of `capacity` Gaussians.
SplatState first(const SplatState& all, long count);

struct SplatRelocate {
  SplatState all;    // of the whole capacity
  long count = 0;    // current number of Gaussians
  long grow_to = 0;  // wanted number of Gaussians, from `count` to the capacity
  std::uint64_t seed = 0;
  std::uint32_t draw = 0;
};
// Returns the new number of Gaussians: `count` if none is opaque enough to be a source, else grow_to. Waits for the
// device once. Every run gives the same bits.
long splat_relocate(Context& ctx, const SplatRelocate& a);

struct SplatNoise {
  SplatParameters x;  // the means change
  float rate = 0;     // per unit of variance
  std::uint64_t seed = 0;
  std::uint32_t draw = 0;
};
void splat_noise(Context& ctx, const SplatNoise& a);

}  // namespace vsplat
