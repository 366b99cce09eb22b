#include "model/fit/density/density.h"

namespace vsplat {

std::unique_ptr<Density> make_density(Context& ctx, DensityStrategy strategy, long capacity) {
  return strategy == DensityStrategy::error ? make_error_density(ctx, capacity) : make_mcmc_density();
}

}  // namespace vsplat
