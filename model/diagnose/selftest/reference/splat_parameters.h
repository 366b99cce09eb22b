// Gaussians from parameters without bounds in double, and what is taken of a loss on them; the derivative is taken by
// differences.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/base/rng.h"

namespace vsplat::ref {

struct SplatParameters {
  std::vector<double> means, log_scales, logits;  // [K,3], [K,3], [K]
};

struct Left {
  double share = 0;
  std::uint64_t seed = 0;
  std::uint32_t draw = 0;

  // Whether Gaussian k is left out: by word 0 of its random number, as part of 2^32.
  bool out(std::size_t k) const {
    const auto word =
        philox4x32_10({static_cast<std::uint32_t>(k), draw, stream_of("fit.dropping"), 0}, rng_key(seed))[0];
    return static_cast<double>(word) < std::floor(share * 4294967296.0);
  }
};

inline double splat_scale(double log_scale) { return std::exp(log_scale); }

inline double splat_opacity(double logit, const Left& left, std::size_t k) {
  return left.out(k) ? 0 : std::min(1.0, 1 / (1 + std::exp(-logit)) / (1 - left.share));
}

// What the parameters of one Gaussian have of the loss: the products with the derivatives by means, scales and
// opacities, and the regularisers.
struct SplatLoss {
  std::vector<double> dmeans, dscales, dopacities;  // the loss's derivatives by the Gaussians
  Left left;
  double opacity_weight = 0, scale_weight = 0, pull = 0;
  std::vector<double> home_means, home_scales;

  double of(const SplatParameters& x, std::size_t k) const {
    double sum = dopacities[k] * splat_opacity(x.logits[k], left, k);
    sum += opacity_weight / (1 + std::exp(-x.logits[k]));
    for (std::size_t i = 3 * k; i < 3 * k + 3; ++i) {
      sum += dmeans[i] * x.means[i] + (dscales[i] + scale_weight) * splat_scale(x.log_scales[i]);
      if (home_means.empty()) continue;
      const double a = x.means[i] - home_means[i], b = x.log_scales[i] - home_scales[i];
      sum += 0.5 * pull * (a * a + b * b);
    }
    return sum;
  }

  // By number `at` of one kind of parameter, which has `each` numbers a Gaussian.
  double slope(SplatParameters x, std::vector<double> SplatParameters::*kind, std::size_t each, std::size_t at) const {
    const double step = 1e-5, base = (x.*kind)[at];
    (x.*kind)[at] = base + step;
    const double up = of(x, at / each);
    (x.*kind)[at] = base - step;
    return (up - of(x, at / each)) / (2 * step);
  }
};

}  // namespace vsplat::ref
