#include "model/diagnose/selftest/reference/ray_loss.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/ray_loss.h"

namespace vsplat::selftest {
namespace {

void ray_loss_all(Checks& c) {
  for (const long r : c.some({1L, 7L, 341L, 343L, 2049L}, {3L, 63L, 64L, 65L, 4099L})) {
    const auto predicted = random_floats(size_of(6 * r), 1), target = random_floats(size_of(6 * r), 2);
    const RayLoss a{c.up({r, 6}, predicted), c.up({r, 6}, target), c.gap({1}), c.gap({r, 6}), 0.25f};
    ray_loss(c.ctx, a);
    c.close("loss", a.out, std::vector<double>{ref::ray_loss(predicted, target)}, 1e-6);
    std::vector<double> by;
    for (std::size_t i = 0; i < target.size(); ++i)
      by.push_back(0.5 * (static_cast<double>(predicted[i]) - target[i]) / static_cast<double>(target.size()));
    c.close("gradient", a.dpredicted, by, 1e-6);
    if (!c.all) continue;
    const Tensor alone = c.gap({1});
    ray_loss(c.ctx, {a.predicted, a.target, alone, {}});
    c.equal("loss without its gradient", alone, c.ctx.read<float>(a.out));
  }
}

}  // namespace

VSPLAT_CASES(ray_loss, {"ray_loss", ray_loss_all})

}  // namespace vsplat::selftest
