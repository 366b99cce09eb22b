// Rays of six numbers as spherical harmonics, in double; the gradient by differences.
#pragma once
#include "model/diagnose/selftest/reference/plucker.h"

namespace vsplat::ref {

// rays [r, 6] -> [r, 32]
inline std::vector<double> ray_harmonics(const std::vector<double>& rays) {
  std::vector<double> out;
  for (std::size_t i = 0; i < rays.size(); i += 3)
    for (const double v : real_sh3({rays[i], rays[i + 1], rays[i + 2]})) out.push_back(v);
  return out;
}

// The gradient of sum(dy ray_harmonics()) by the rays.
inline std::vector<double> ray_harmonics_gradient(std::vector<double> rays, const std::vector<float>& dy) {
  std::vector<double> out;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double before = rays[i];
    double slope = 0;
    for (const double sign : {1.0, -1.0}) {
      rays[i] = before + sign * 1e-5;
      const std::size_t first = i / 3 * 3;
      const auto y = real_sh3({rays[first], rays[first + 1], rays[first + 2]});
      for (std::size_t k = 0; k < y.size(); ++k) slope += sign * y[k] * dy[i / 3 * 16 + k] / 2e-5;
    }
    rays[i] = before;
    out.push_back(slope);
  }
  return out;
}

}  // namespace vsplat::ref
