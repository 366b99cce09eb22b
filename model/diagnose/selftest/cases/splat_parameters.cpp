#include "model/diagnose/selftest/reference/splat_parameters.h"

#include <array>
#include <cmath>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/loss.h"
#include "model/ops/fit/splat_parameters.h"

namespace vsplat::selftest {
namespace {

// got / want, for what spans many magnitudes; 1 where both are 0.
std::vector<float> ratios(const std::vector<float>& got, const std::vector<double>& want) {
  std::vector<float> out;
  for (std::size_t i = 0; i < got.size(); ++i)
    out.push_back(want[i] != 0 ? static_cast<float>(got[i] / want[i]) : got[i] == 0 ? 1.0f : 2.0f);
  return out;
}

// `weights`: of opacities, of scales, and of the distance from where a Gaussian began.
void splat_parameters_of(Checks& c, long n, const Dropping& dropping, const std::array<float, 3>& weights) {
  const std::size_t k = size_of(n);
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
  if (c.all) {
    c.close("scales, each", ratios(c.ctx.read<float>(f.scales), scales), std::vector<double>(3 * k, 1), 2e-6);
    c.close("opacities, each", ratios(c.ctx.read<float>(f.opacities), opacities), std::vector<double>(k, 1), 2e-6);
  }
  SplatParametersBackward b{x, dropping, {c.up({n, 3}, dmeans), c.up({n, 3}, dscales), {}, c.up({n}, dopacities), {}}};
  b.opacity_weight = weights[0], b.scale_weight = weights[1], b.pull = weights[2];
  if (b.pull > 0) b.home_means = c.up({n, 3}, home), b.home_scales = c.up({n, 3}, home_scales);
  splat_parameters_backward(c.ctx, b);
  const ref::SplatLoss loss{as_doubles(dmeans),
                            as_doubles(dscales),
                            as_doubles(dopacities),
                            left,
                            static_cast<double>(weights[0]),
                            static_cast<double>(weights[1]),
                            static_cast<double>(weights[2]),
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

void splat_parameters_all(Checks& c) {
  for (const long n : c.some({3L, 7L, 63L, 64L, 65L, 1009L}))
    splat_parameters_of(c, n, {n > 7 ? 0.2f : 0.0f, 11, 3}, {0.3f, 0.2f, 0.5f});
  if (!c.all) return;
  for (const long n : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1009L}) {
    splat_parameters_of(c, n, {}, {0, 0, 0});
    splat_parameters_of(c, n, {0.3f, 0x123456789abcdefu, 17}, {0, 0, 0});
    splat_parameters_of(c, n, {0.75f, 0x123456789abcdefu, 17}, {0, 0, 0});
    splat_parameters_of(c, n, {0.4f, 99, 3}, {0.7f, 0.3f, 0.9f});
  }
  for (const auto& weights : {std::array<float, 3>{1.5f, 0, 0}, {0, 1.5f, 0}, {0, 0, 1.5f}})
    splat_parameters_of(c, 65, {}, weights);
  splat_parameters_of(c, 65, {0.5f, 7, 8}, {0, 0, 0});
}

}  // namespace

VSPLAT_CASES(splat_parameters, {"splat_parameters", splat_parameters_all})

}  // namespace vsplat::selftest
