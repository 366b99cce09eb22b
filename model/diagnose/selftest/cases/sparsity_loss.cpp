#include "model/ops/fit/sparsity_loss.h"

#include <cmath>

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

// By central differences, in double.
double slope(double opacity) {
  const double step = 1e-5;
  return (std::log(1 + (opacity + step) / 0.05) - std::log(1 + (opacity - step) / 0.05)) / (2 * step);
}

void sparsity_loss_all(Checks& c) {
  for (const long k : c.some({1L, 7L, 341L}, {3L, 63L, 64L, 65L, 4099L})) {
    auto opacities = random_floats(size_of(k), 1, 0.0f, 1.0f);
    opacities.front() = 0.0f, opacities.back() = 1.0f;
    const auto before = random_floats(size_of(k), 2);
    const Tensor out = c.up({k}, before);
    sparsity_loss(c.ctx, {c.up({k}, opacities), out, 0.5f});
    std::vector<double> want;
    for (std::size_t i = 0; i < before.size(); ++i)
      want.push_back(before[i] + 0.5 / static_cast<double>(k) * slope(opacities[i]));
    c.close("gradient", out, want, 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(sparsity_loss, {"sparsity_loss", sparsity_loss_all})

}  // namespace vsplat::selftest
