// The loss terms on surfels' surface, in double: the reference for cl/fit/surface_loss.cl.
#pragma once
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// `held`: the alphas that normals are multiplied by.
inline double surface_loss(const std::vector<double>& normal, const std::vector<double>& depth_normal,
                           const std::vector<double>& held, const std::vector<double>& distortion,
                           double distortion_weight, double normal_weight) {
  double out = 0;
  for (std::size_t i = 0; i < held.size(); ++i) {
    double agree = 0;
    for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) agree += normal[c] * depth_normal[c];
    out += distortion_weight * distortion[i] + normal_weight * held[i] * (1 - agree);
  }
  return out / static_cast<double>(held.size());
}

}  // namespace vsplat::ref
