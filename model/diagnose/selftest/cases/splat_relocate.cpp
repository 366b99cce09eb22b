#include "model/diagnose/selftest/reference/splat_relocate.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/fit_states.h"
#include "model/diagnose/selftest/reference/splat_parameters.h"
#include "model/ops/fit/splat_parameters.h"
#include "model/ops/fit/splat_relocate.h"

namespace vsplat::selftest {
namespace {

constexpr float kGone = -20;  // the logit of a Gaussian that is relocated
constexpr double kLeast = 0.005, kMost = 1.0f - 1e-6f;

struct Relocation {
  std::vector<float> logits;
  std::size_t grow_to, capacity;
  std::size_t s = 4;
  bool exact = false;  // all opacities are 0, 1/2 or 1, which weights have exactly: each point's source is known
  std::uint32_t draw = 5;
};

// The sources of all points where weights are exact: those of a walk over all.
std::vector<std::size_t> exact_sources(const Relocation& t, std::size_t points) {
  std::vector<std::uint32_t> weights;
  std::uint64_t total = 0;
  const double finest = std::floor(std::min(4294967040.0 / static_cast<double>(t.logits.size()) - 1, 65535.0));
  for (const float l : t.logits) {
    weights.push_back(l < 0 ? 0 : static_cast<std::uint32_t>((l > 0 ? 1 : 0.5) * finest) + 1);
    total += weights.back();
  }
  return ref::systematic_sources(weights, points, ref::systematic_offset(3, t.draw, total));
}

// That each source has as many points as its opacity's share of them, up to one and what the weights' rounding moves.
bool in_proportion(const Relocation& t, const std::vector<std::size_t>& sources) {
  std::vector<int> taken(t.logits.size());
  double sum = 0;
  for (const std::size_t k : sources) ++taken[k];
  for (const float x : t.logits) sum += sigmoid(x) >= kLeast ? sigmoid(x) : 0;
  bool right = std::is_sorted(sources.begin(), sources.end());
  for (std::size_t k = 0; k < taken.size(); ++k) {
    const double share = sigmoid(t.logits[k]) >= kLeast ? sigmoid(t.logits[k]) / sum : 0;
    right = right && std::abs(taken[k] - share * static_cast<double>(sources.size())) <= (share > 0 ? 1.01 : 0);
  }
  return right;
}

void splat_relocate_of(Checks& c, const Relocation& t) {
  const std::size_t count = t.logits.size(), s3 = 3 * t.s;
  FitState before{fit_rows(count, t.capacity, 1, t.s), fit_rows(count, t.capacity, 11, t.s),
                  fit_rows(count, t.capacity, 21, t.s)};
  std::copy(t.logits.begin(), t.logits.end(), before.x.logits.begin());
  for (std::size_t k = 0; k < count; ++k) before.x.means[3 * k] = static_cast<float>(k);  // tells its copies
  const SplatRelocate a{{up_rows(c.ctx, before.x), up_rows(c.ctx, before.m), up_rows(c.ctx, before.v)},
                        static_cast<long>(count),
                        static_cast<long>(t.grow_to),
                        3,
                        t.draw};
  c.that("how many", splat_relocate(c.ctx, a) == static_cast<long>(t.grow_to));
  const FitState after{read_rows(c.ctx, a.all.x), read_rows(c.ctx, a.all.m), read_rows(c.ctx, a.all.v)};
  // Points go to those that move, in their order, then behind the last.
  const auto moves = [&](std::size_t k) { return k >= count || !(sigmoid(t.logits[k]) >= kLeast); };
  std::vector<std::size_t> sources;
  bool there = true;
  for (std::size_t k = 0; k < t.grow_to; ++k) {
    const float from = after.x.means[3 * k];
    there = there && from >= 0 && from < static_cast<float>(count);
    if (there && moves(k)) sources.push_back(static_cast<std::size_t>(from));
  }
  c.that("sources are there", there);
  if (!there) return;
  if (!t.exact)
    c.that("sources in proportion to opacities", in_proportion(t, sources));
  else if (!sources.empty())
    c.equal("sources", sources, exact_sources(t, sources.size()));
  std::map<std::size_t, int> taken;
  for (const std::size_t k : sources) ++taken[k];
  FitState want = before;
  std::vector<double> logits = as_doubles(before.x.logits), log_scales = as_doubles(before.x.log_scales);
  for (std::size_t k = 0, point = 0; k < t.grow_to; ++k) {
    const std::size_t source = moves(k) ? sources[point++] : k;
    if (taken.count(source) == 0) continue;
    const double opacity = std::min(sigmoid(before.x.logits[source]), kMost);
    const int equal = taken[source] + 1;
    const double each = std::max(ref::shared_opacity(opacity, equal), kLeast);
    logits[k] = std::log(each / (1 - each));
    const double longer = std::log(ref::shared_scale(opacity, equal));
    want.m.logits[k] = want.v.logits[k] = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      log_scales[3 * k + i] = before.x.log_scales[3 * source + i] + longer;
      want.m.log_scales[3 * k + i] = want.v.log_scales[3 * k + i] = 0;
    }
    if (!moves(k)) continue;
    for (const auto& [kind, width] :
         {std::pair{&FitRows::means, std::size_t{3}}, {&FitRows::quats, 4}, {&FitRows::sh, s3}}) {
      std::copy_n(&(before.x.*kind)[width * source], width, &(want.x.*kind)[width * k]);
      std::fill_n(&(want.m.*kind)[width * k], width, 0.0f), std::fill_n(&(want.v.*kind)[width * k], width, 0.0f);
    }
  }
  // The rounding of an opacity near 1 is much of what is missing to 1.
  c.close("opacities", a.all.x.logits, logits, 1e-5);
  c.close("scales", a.all.x.log_scales, log_scales, 1e-6);
  c.equal("means", after.x.means, want.x.means);
  c.equal("rotations", after.x.quats, want.x.quats);
  c.equal("harmonics", after.x.sh, want.x.sh);
  for (const auto kind : kFitKinds) {
    c.equal("moments", after.m.*kind, want.m.*kind);
    c.equal("moments", after.v.*kind, want.v.*kind);
  }
}

void splat_relocate_of(Checks& c, std::size_t count, double growth) {
  std::vector<float> logits;
  logits.reserve(count);
  for (const float r : random_floats(count, static_cast<std::uint32_t>(count), 0, 1))
    logits.push_back(r < 0.3f ? kGone : r < 0.7f ? 0.0f : 20.0f);
  logits[count / 2] = 0;
  const auto grow_to = static_cast<std::size_t>(growth * static_cast<double>(count));
  splat_relocate_of(c, {logits, grow_to, grow_to + 2, 4, true});
}

// What only the tests run.
void splat_relocate_more(Checks& c) {
  for (const std::size_t count : {1UL, 3UL, 7UL, 63UL, 64UL, 65UL, 1009UL, 100003UL})
    for (const double growth : {1.0, 1.3, 2.9}) splat_relocate_of(c, count, growth);
  // A point on the border of two belongs to the second. (The draw is one of those that begin at 0.)
  std::uint32_t draw = 0;
  while (ref::systematic_offset(3, draw, 65536) != 0) ++draw;
  splat_relocate_of(c, {{0, 0}, 4, 4, 4, true, draw});
  for (const std::size_t count : {1000UL, 100003UL})
    for (const float low : {-9.0f, -4.0f}) {
      auto logits = random_floats(count, 5, low, 4);
      for (float& x : logits)
        if (std::abs(sigmoid(x) - kLeast) < 1e-6) x += 0.01f;
      splat_relocate_of(c, {logits, count + count / 3, count + count / 3, 1});
    }
  for (const std::size_t s : {1UL, 4UL, 9UL, 16UL}) splat_relocate_of(c, {{1, kGone, -1, kGone, 0.5f}, 8, 9, s});
  std::vector<float> all_but_one(300, kGone);
  all_but_one[123] = 3;
  splat_relocate_of(c, {all_but_one, 305, 310});
  // What is nearly transparent by less than it takes stays.
  splat_relocate_of(c, {{8, logit(0.00501), logit(0.00499), -12, -200, 8}, 6, 6});
}

void splat_relocate_all(Checks& c) {
  for (const std::size_t count : c.some({3UL, 7UL, 63UL, 64UL, 65UL, 1009UL, 20011UL}))
    for (const double growth : {1.0, 1.3}) splat_relocate_of(c, count, growth);
  if (c.all) splat_relocate_more(c);
  for (const std::size_t n : c.some({1UL, 7UL, 63UL, 65UL, 1009UL}, {0UL, 3UL, 64UL})) {
    FitRows x = fit_rows(n, n, 1);
    x.logits = random_floats(n, 8, -8, -2.5f);
    x.means.assign(3 * n, 0.0f), x.quats = random_floats(4 * n, 9, -2, 2);
    const SplatNoise a{up_rows(c.ctx, x), 3, 3, 5};
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
