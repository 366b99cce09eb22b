// Relocation and growth of 3DGS-MCMC (Kheradmand et al. 2024).
#include "model/fit/density/density.h"

namespace vsplat {
namespace {

class McmcDensity : public Density {
 public:
  long grow(Context& ctx, const GrowStep& s) override {
    return splat_relocate(ctx, {s.all, s.count, s.grow_to, s.seed, s.steps});
  }
};

}  // namespace

std::unique_ptr<Density> make_mcmc_density() { return std::make_unique<McmcDensity>(); }

}  // namespace vsplat
