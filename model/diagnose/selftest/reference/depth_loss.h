// The loss on a picture's depth, in double.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

struct DepthLossInput {
  std::vector<double> depth, alpha, given;
  bool metric = true, inverse = false;

  bool counts(std::size_t i) const { return given[i] > 0 && alpha[i] > 1.0 / 255 && depth[i] > 0; }
};

// The depth wanted for each pixel; 0: none.
inline std::vector<double> wanted_depths(const DepthLossInput& in) {
  if (in.metric) return in.given;
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t i = 0; i < in.given.size(); ++i) {
    if (!in.counts(i)) continue;
    const double e = in.depth[i] / in.alpha[i], to = in.inverse ? 1 / e : e, w = in.alpha[i];
    n += w, x += w * in.given[i], y += w * to, xx += w * in.given[i] * in.given[i], xy += w * in.given[i] * to;
  }
  const double a = (n * xy - x * y) / (n * xx - x * x), b = (y - a * x) / n;
  std::vector<double> out(in.given.size(), 0.0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double fitted = a * in.given[i] + b;
    if (a > 0 && fitted > 0) out[i] = in.inverse ? 1 / fitted : fitted;
  }
  return out;
}

// With the weighing alphas of `in`, and the slopes by another depth and alpha.
inline double depth_loss(const DepthLossInput& in, const std::vector<double>& want, std::size_t i, double depth,
                         double alpha, double slope) {
  if (!in.counts(i) || !(want[i] > 0)) return 0;
  return slope * (in.alpha[i] * std::abs(std::log(depth / alpha) - std::log(want[i])) + 1 - alpha);
}

}  // namespace vsplat::ref
