// Where a fit takes Gaussians away and adds others: one strategy a file. A new one is a class, and a line of
// make_density().
#pragma once
#include <cstdint>
#include <memory>

#include "model/ops/fit/splat_relocate.h"

namespace vsplat {

enum class DensityStrategy {
  mcmc,   // Gaussians that are nearly transparent move to others, drawn in proportion to opacity, which share theirs
  error,  // Gaussians that cover the pictures' errors are split along their longest axis
};

struct GrowStep {
  SplatState all;           // of the whole capacity, changed in place
  long count = 0;           // current number of Gaussians
  long grow_to = 0;         // wanted number, from `count` to the capacity
  std::uint64_t seed = 0;   // of the fit
  std::uint32_t steps = 0;  // done
};

class Density {
 public:
  virtual ~Density() = default;
  // Replaces nearly transparent Gaussians, and adds others. Returns the new number. Every run gives the same bits.
  virtual long grow(Context& ctx, const GrowStep& step) = 0;
  // f32 [capacity]: for each Gaussian the sum over the steps since the last grow() of blending weight times the
  // picture's error, which the caller adds to (add_scores()) and stores in checkpoints. None if the strategy uses none.
  virtual Tensor scores() const { return {}; }
};

std::unique_ptr<Density> make_density(Context& ctx, DensityStrategy strategy, long capacity);

// The strategies.
std::unique_ptr<Density> make_mcmc_density();
std::unique_ptr<Density> make_error_density(Context& ctx, long capacity);

}  // namespace vsplat
