#include "model/diagnose/selftest/reference/splat_relocate.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/splat_parameters.h"
#include "model/ops/fit/splat_parameters.h"
#include "model/ops/fit/splat_relocate.h"

namespace vsplat::selftest {
namespace {

struct FitRows {
  std::vector<float> means, log_scales, quats, logits, sh;
};

FitRows fit_rows(const std::vector<float>& logits, std::size_t capacity, std::uint32_t seed) {
  const auto random = [&](std::size_t each) {
    auto out = random_floats(each * logits.size(), seed++, -3, -1);
    out.resize(each * capacity, 7.0f);
    return out;
  };
  return {random(3), random(3), random(4), random(1), random(12)};
}

SplatParameters up_rows(Checks& c, const FitRows& r) {
  const long n = static_cast<long>(r.logits.size());
  return {c.up({n, 3}, r.means), c.up({n, 3}, r.log_scales), c.up({n, 4}, r.quats), c.up({n}, r.logits),
          c.up({n, 4, 3}, r.sh)};
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

// Opacities of 1/2 and 1, whose weights float32 cannot round: each point's source is that of a walk over all points.
void splat_relocate_of(Checks& c, std::size_t count, double growth) {
  constexpr float gone = -20;
  const auto random = random_floats(count, static_cast<std::uint32_t>(count), 0, 1);
  std::vector<float> logits;
  logits.reserve(count);
  for (const float r : random) logits.push_back(r < 0.3f ? gone : r < 0.7f ? 0.0f : 20.0f);
  logits[count / 2] = 0;
  const auto grow_to = static_cast<std::size_t>(growth * static_cast<double>(count)), capacity = grow_to + 2;
  FitRows x = fit_rows(logits, capacity, 1);
  const FitRows m = fit_rows(logits, capacity, 11), v = fit_rows(logits, capacity, 21);
  std::copy(logits.begin(), logits.end(), x.logits.begin());
  std::vector<std::uint32_t> weights;
  std::uint64_t total = 0, moving = 0;
  const double finest = std::floor(std::min(4294967040.0 / static_cast<double>(count) - 1, 65535.0));
  for (const float l : logits) {
    weights.push_back(l < 0 ? 0 : static_cast<std::uint32_t>((l > 0 ? 1 : 0.5) * finest) + 1);
    total += weights.back(), moving += l < 0;
  }
  const std::uint64_t points = moving + grow_to - count;
  const SplatRelocate a{
      {up_rows(c, x), up_rows(c, m), up_rows(c, v)}, static_cast<long>(count), static_cast<long>(grow_to), 3, 5};
  c.that("how many", splat_relocate(c.ctx, a) == static_cast<long>(grow_to));
  std::vector<std::size_t> sources;
  if (points > 0) sources = ref::systematic_sources(weights, points, ref::systematic_offset(3, 5, total));
  std::map<std::size_t, int> taken;
  for (const std::size_t k : sources) ++taken[k];
  std::vector<double> new_logits = as_doubles(x.logits), new_scales = as_doubles(x.log_scales);
  std::vector<float> means = x.means, quats = x.quats, sh = x.sh, moments = m.means;
  for (std::size_t k = 0, point = 0; k < grow_to; ++k) {
    const bool moves = k >= count || logits[k] < 0;
    const std::size_t source = moves ? sources[point++] : k;
    if (taken.count(source) == 0) continue;
    const double opacity = std::min(sigmoid(logits[source]), static_cast<double>(1.0f - 1e-6f));
    const int equal = taken[source] + 1;
    const double each = std::max(ref::shared_opacity(opacity, equal), 0.005);
    new_logits[k] = std::log(each / (1 - each));
    for (std::size_t i = 0; i < 3; ++i)
      new_scales[3 * k + i] = x.log_scales[3 * source + i] + std::log(ref::shared_scale(opacity, equal));
    for (std::size_t i = 0; moves && i < 12; ++i) {
      if (i < 3) means[3 * k + i] = x.means[3 * source + i], moments[3 * k + i] = 0;
      if (i < 4) quats[4 * k + i] = x.quats[4 * source + i];
      sh[12 * k + i] = x.sh[12 * source + i];
    }
  }
  c.close("opacities", a.all.x.logits, new_logits, 1e-5);
  c.close("scales", a.all.x.log_scales, new_scales, 1e-6);
  c.equal("means", a.all.x.means, means);
  c.equal("rotations", a.all.x.quats, quats);
  c.equal("harmonics", a.all.x.sh, sh);
  c.equal("moments", a.all.m.means, moments);
}

void splat_relocate_all(Checks& c) {
  for (const std::size_t count : c.some({3UL, 7UL, 63UL, 64UL, 65UL, 1009UL, 20011UL}))
    for (const double growth : {1.0, 1.3}) splat_relocate_of(c, count, growth);
  for (const std::size_t n : c.some({1UL, 7UL, 63UL, 65UL, 1009UL}, {0UL, 3UL, 64UL})) {
    FitRows x = fit_rows(random_floats(n, 8, -8, -2.5f), n, 1);
    x.logits = random_floats(n, 8, -8, -2.5f);
    x.means.assign(3 * n, 0.0f), x.quats = random_floats(4 * n, 9, -2, 2);
    const SplatNoise a{up_rows(c, x), 3, 3, 5};
    splat_noise(c.ctx, a);
    std::vector<double> want;
    for (std::size_t k = 0; k < n; ++k) {
      const float *s = &x.log_scales[3 * k], *q = &x.quats[4 * k];
      const auto cov = ref::covariance({s[0], s[1], s[2]}, {q[0], q[1], q[2], q[3]});
      const auto xi = ref::normal_numbers(k, 3, 5);
      for (const auto& row : cov)
        want.push_back(3 * ref::wandering(sigmoid(x.logits[k])) * (row[0] * xi[0] + row[1] * xi[1] + row[2] * xi[2]));
    }
    c.close("noise", a.x.means, want, 1e-5);
    if (!c.all) continue;
    std::vector<float> each = c.ctx.read<float>(a.x.means);  // in units of the largest move along an axis
    for (std::size_t k = 0; k < n; ++k) {
      const auto row = want.begin() + static_cast<std::ptrdiff_t>(3 * k);
      const double most = std::max({std::abs(row[0]), std::abs(row[1]), std::abs(row[2])});
      for (std::size_t i = 0; i < 3; ++i) each[3 * k + i] = static_cast<float>(each[3 * k + i] / most);
      for (std::ptrdiff_t i = 0; i < 3; ++i) row[i] /= most;
    }
    c.close("noise, each", each, want, 1e-5);
  }
}

}  // namespace

VSPLAT_CASES(splat_relocate, {"splat_relocate", splat_relocate_all})

}  // namespace vsplat::selftest
