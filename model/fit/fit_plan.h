// The memory that a fit takes, found by planning a step and a measurement on a held-out view.
#pragma once
#include "model/fit/fitter.h"

namespace vsplat {

struct FitMemory {
  std::size_t peak = 0;  // bytes, including what is allocated already
  std::vector<StageMemory> stages;
};

// Assumes that `start` grows to options.max_gaussians, and that each Gaussian touches eight tiles of a picture.
FitMemory plan_fit(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                   const Camera& camera);

// The largest options.max_gaussians, up to the given one, that the device memory that may be used allows; the start's
// number if it allows none.
long affordable_gaussians(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                          const Camera& camera);

// Bytes of device memory left beside the fit. Error(memory) with both figures if the fit needs more than may be used.
std::size_t spare_room(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                       const Camera& camera);

}  // namespace vsplat
