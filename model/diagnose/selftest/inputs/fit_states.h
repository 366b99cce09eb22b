// The state of a fit on the host: parameters and both moments, with unused rows behind the last Gaussian.
#pragma once
#include <cmath>
#include <vector>

#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/ops/fit/splat_parameters.h"

namespace vsplat::selftest {

inline double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }
inline float logit(double p) { return static_cast<float>(std::log(p / (1 - p))); }

struct FitRows {
  std::vector<float> means, log_scales, quats, logits, sh;
  bool operator==(const FitRows&) const = default;
};
inline constexpr std::vector<float> FitRows::*kFitKinds[] = {&FitRows::means, &FitRows::log_scales, &FitRows::quats,
                                                             &FitRows::logits, &FitRows::sh};

struct FitState {
  FitRows x, m, v;
  bool operator==(const FitState&) const = default;
};

inline FitRows fit_rows(std::size_t count, std::size_t capacity, std::uint32_t seed, std::size_t s = 4) {
  const auto random = [&](std::size_t each) {
    auto out = random_floats(each * count, seed++, -3, -1);
    out.resize(each * capacity, 7.0f);
    return out;
  };
  return {random(3), random(3), random(4), random(1), random(3 * s)};
}

inline SplatParameters up_rows(Context& ctx, const FitRows& r) {
  const long n = static_cast<long>(r.logits.size()), s = n > 0 ? static_cast<long>(r.sh.size()) / (3 * n) : 1;
  return {ctx.upload({n, 3}, r.means), ctx.upload({n, 3}, r.log_scales), ctx.upload({n, 4}, r.quats),
          ctx.upload({n}, r.logits), ctx.upload({n, s, 3}, r.sh)};
}

inline FitRows read_rows(Context& ctx, const SplatParameters& x) {
  return {ctx.read<float>(x.means), ctx.read<float>(x.log_scales), ctx.read<float>(x.quats), ctx.read<float>(x.logits),
          ctx.read<float>(x.sh)};
}

}  // namespace vsplat::selftest
