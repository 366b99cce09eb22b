#include "model/diagnose/selftest/reference/select.h"

#include <cmath>
#include <string>

#include "model/base/rng.h"
#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/volume/select.h"

namespace vsplat::selftest {
namespace {

void select_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1009L}, {7L, 4099L}))
    for (const std::string selection : {"gumbel", "sigmoid", "ste", "opacity"})
      for (const bool noisy : c.some({true}, {false})) {
        const std::size_t count = size_of(n);
        const auto logits = random_floats(count, 51), opacities = random_floats(count, 52, 0.0f, 1.0f),
                   noise = random_floats(count, 53, -2.0f, 2.0f), d = random_floats(count, 57, 0.5f, 1.5f);
        SelectForward f;
        f.logits = c.up({n}, logits);
        if (noisy) f.noise = c.up({n}, noise);
        f.opacities = c.up({n}, opacities);
        f.selection = selection_of(selection), f.temperature = 0.3f, f.opacity_threshold = 0.4f;
        f.factor = c.gap({n}), f.refined = c.gap({n}), f.flags = c.up({n}, std::vector<std::uint32_t>(count, 7));
        select_forward(c.ctx, f);
        std::vector<double> factor, refined, by_logit, by_opacity;
        std::vector<std::uint32_t> flags;
        for (std::size_t i = 0; i < count; ++i) {
          const auto one =
              ref::select(selection, logits[i], noisy ? noise[i] : 0.0, opacities[i], static_cast<double>(0.3f), 0.4f);
          const auto by = ref::select_backward(selection, logits[i], noisy ? noise[i] : 0.0, opacities[i],
                                               static_cast<double>(0.3f), d[i]);
          factor.push_back(one.factor), refined.push_back(one.refined), flags.push_back(one.flag);
          by_logit.push_back(by.logit), by_opacity.push_back(by.opacity);
        }
        c.close("factor", f.factor, factor, 1e-6);
        c.close("refined", f.refined, refined, 1e-6);
        c.equal("flags", f.flags, flags);
        const SelectBackward b{f.logits,      f.noise,      f.opacities, f.selection,
                               f.temperature, c.up({n}, d), c.gap({n}),  c.gap({n})};
        select_backward(c.ctx, b);
        c.close("backward, dlogits", b.dlogits, by_logit, 2e-6);
        c.close("backward, dopacities", b.dopacities, by_opacity, 1e-6);
        if (!c.all) continue;
        SelectBackward in_place = b;
        in_place.dopacities = in_place.drefined, in_place.dlogits = {};
        select_backward(c.ctx, in_place);
        c.close("backward, dopacities, in place", in_place.drefined, by_opacity, 1e-6);
      }
  const long n = c.all ? 20001 : 2001;
  const std::uint64_t seed = 0x123456789abcdefULL;
  const Tensor noise = c.gap({n});
  logistic_noise(c.ctx, noise, seed, 7, 3);
  std::vector<double> want;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double u = uniform_open(philox4x32_10({i, 7, 3, 0}, rng_key(seed))[0]);
    want.push_back(std::log(u) - std::log(1 - u));
  }
  c.close("noise", noise, want, 1e-6);
}

}  // namespace

VSPLAT_CASES(select, {"select", select_all})

}  // namespace vsplat::selftest
