#include "model/render/supersample.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace vsplat {
namespace {

// Width of a pixel at a position; 0 if the position is not in front of the camera.
double pixel_at(const Camera& camera, const Eigen::Vector3d& at) {
  const double z = (camera.w2c * at.homogeneous())[2];
  return z > 0 && camera.fx > 0 ? z / camera.fx : 0;
}

}  // namespace

Camera times_as_large(const Camera& camera, int k) {
  Camera out = camera;
  out.width *= k, out.height *= k;
  out.fx *= k, out.fy *= k, out.cx *= k, out.cy *= k;
  return out;
}

std::optional<Detail> detail_of(const std::vector<Camera>& cameras, const Eigen::Vector3d& at) {
  std::vector<double> widths;
  for (const Camera& camera : cameras)
    if (const double width = pixel_at(camera, at); width > 0) widths.push_back(width);
  if (widths.empty()) return {};
  const auto middle = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2);
  std::nth_element(widths.begin(), middle, widths.end());
  const auto pixel = static_cast<float>(*middle);
  if (!(pixel > 0) || !std::isfinite(pixel)) return {};
  return Detail{{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])}, pixel};
}

int samples_for(const Detail& detail, const Camera& camera) {
  const double width = pixel_at(camera, Eigen::Vector3d(detail.at[0], detail.at[1], detail.at[2]));
  const int most = std::min(kMostSamples, kLargestSampled / std::max({camera.width, camera.height, 1}));
  constexpr double rounding = 1e-3;  // tolerance for rounding of exact multiples
  return static_cast<int>(std::clamp(width / detail.pixel + rounding, 1.0, static_cast<double>(std::max(most, 1))));
}

}  // namespace vsplat
