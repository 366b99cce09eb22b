#include "model/diagnose/selftest/reference/splat_parameters.h"

#include <cmath>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/loss.h"
#include "model/ops/fit/splat_parameters.h"

namespace vsplat::selftest {
namespace {

void splat_parameters_all(Checks& c) {
  for (const long n : c.some({3L, 7L, 63L, 64L, 65L, 1009L})) {
    const std::size_t k = size_of(n);
    const Dropping dropping{n > 7 ? 0.2f : 0.0f, 11, 3};
    const auto means = random_floats(3 * k, 1), log_scales = random_floats(3 * k, 2, -7.8f, 0.5f),
               home = random_floats(3 * k, 8), home_scales = random_floats(3 * k, 9), dmeans = random_floats(3 * k, 4),
               dscales = random_floats(3 * k, 5), dopacities = random_floats(k, 6);
    auto logits = random_floats(k, 3, -8, 8);
    for (float& v : logits)  // none is near 1 after it is raised, where it is held
      if (std::abs(1 / (1 + std::exp(-v)) / (1 - dropping.share) - 1) < 1e-3f) v += 0.5f;
    const SplatParameters x{c.up({n, 3}, means), c.up({n, 3}, log_scales), c.gap({n, 4}), c.up({n}, logits),
                            c.gap({n, 4, 3})};
    const SplatParametersForward f{x, dropping, c.gap({n, 3}), c.gap({n})};
    splat_parameters_forward(c.ctx, f);
    const ref::Left left{static_cast<double>(dropping.share), dropping.seed, dropping.draw};
    std::vector<double> scales, opacities;
    for (const float v : log_scales) scales.push_back(ref::splat_scale(v));
    for (std::size_t i = 0; i < k; ++i) opacities.push_back(ref::splat_opacity(logits[i], left, i));
    c.close("scales", f.scales, scales, 1e-6);
    c.close("opacities", f.opacities, opacities, 1e-6);
    SplatParametersBackward b{
        x, dropping, {c.up({n, 3}, dmeans), c.up({n, 3}, dscales), {}, c.up({n}, dopacities), {}}};
    b.opacity_weight = 0.3f, b.scale_weight = 0.2f, b.pull = 0.5f;
    b.home_means = c.up({n, 3}, home), b.home_scales = c.up({n, 3}, home_scales);
    splat_parameters_backward(c.ctx, b);
    const ref::SplatLoss loss{as_doubles(dmeans),
                              as_doubles(dscales),
                              as_doubles(dopacities),
                              left,
                              static_cast<double>(0.3f),
                              static_cast<double>(0.2f),
                              0.5,
                              as_doubles(home),
                              as_doubles(home_scales)};
    const ref::SplatParameters at{as_doubles(means), as_doubles(log_scales), as_doubles(logits)};
    const auto by = [&](std::vector<double> ref::SplatParameters::*kind, std::size_t each) {
      std::vector<double> out;
      for (std::size_t i = 0; i < each * k; ++i) out.push_back(loss.slope(at, kind, each, i));
      return out;
    };
    c.close(
        "backward, means", b.dgaussians.means, [&] { return by(&ref::SplatParameters::means, 3); }, 2e-6);
    c.close(
        "backward, scales", b.dgaussians.scales, [&] { return by(&ref::SplatParameters::log_scales, 3); }, 2e-6);
    c.close(
        "backward, logits", b.dgaussians.opacities, [&] { return by(&ref::SplatParameters::logits, 1); }, 2e-6);
  }
}

}  // namespace

VSPLAT_CASES(splat_parameters, {"splat_parameters", splat_parameters_all})

}  // namespace vsplat::selftest
