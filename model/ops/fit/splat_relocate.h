// Nearly transparent Gaussians go to where others are, new ones come there, and little seen ones wander: 3D Gaussian
// splatting as Markov chain Monte Carlo (Kheradmand et al. 2024); see cl/fit/splat_relocate.cl.
#pragma once
#include <cstdint>

#include "model/ops/fit/splat_parameters.h"

namespace vsplat {

// Parameters and their moments in memory for more Gaussians than there are.
struct SplatState {
  SplatParameters x, m, v;
};
// Of `capacity` Gaussians the first `count`.
SplatState first(const SplatState& all, long count);

struct SplatRelocate {
  SplatState all;    // of the whole capacity
  long count = 0;    // Gaussians there are
  long grow_to = 0;  // Gaussians there shall be, from `count` to the capacity
  std::uint64_t seed = 0;
  std::uint32_t draw = 0;
};
// Returns how many there are then: `count` where none is opaque enough to be a source, else grow_to. Waits for the
// device once. Every run gives the same bits.
long splat_relocate(Context& ctx, const SplatRelocate& a);

struct SplatNoise {
  SplatParameters x;  // the means are moved
  float rate = 0;     // per unit of variance
  std::uint64_t seed = 0;
  std::uint32_t draw = 0;
};
void splat_noise(Context& ctx, const SplatNoise& a);

}  // namespace vsplat
