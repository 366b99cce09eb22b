// What memory a fit takes, found by running its first step on a plan.
#pragma once
#include "model/fit/fitter.h"

namespace vsplat {

struct FitMemory {
  std::size_t peak = 0;  // bytes, with what is there already
  std::vector<StageMemory> stages;
};

// `start` grows to options.max_gaussians; each is taken to touch eight tiles of a picture.
FitMemory plan_fit(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                   const Camera& camera);

// Bytes that are left beside it. Error(memory) with both figures where that is more than may be used.
std::size_t spare_room(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                       const Camera& camera);

}  // namespace vsplat
