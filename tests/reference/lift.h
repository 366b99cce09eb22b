// Lifting in double, with all samples of a voxel in memory.
#pragma once
#include "tests/reference/project_features.h"

namespace vsplat::ref {

struct Lifted {
  std::vector<double> mean, variance;  // [R^3, C]; the variance is the biased one
};

// features [V, t, t, C]
inline Lifted lift(const std::vector<float>& features, long t, long channels, const std::vector<Camera>& cameras,
                   int image, bool half_pixel, int volume) {
  Lifted out;
  const double views = static_cast<double>(cameras.size());
  for (int i = 0; i < volume; ++i) {
    for (int j = 0; j < volume; ++j) {
      for (int k = 0; k < volume; ++k) {
        const Eigen::Vector3d point = (Eigen::Vector3d(i, j, k).array() + 0.5) / volume - 0.5;
        std::vector<std::vector<double>> samples(cameras.size());
        for (std::size_t v = 0; v < cameras.size(); ++v)
          sample_view(features, t, channels, static_cast<long>(v), cameras[v], image, half_pixel, point, samples[v]);
        for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c) {
          double mean = 0, variance = 0;
          for (const auto& s : samples) mean += s[c] / views;
          for (const auto& s : samples) variance += (s[c] - mean) * (s[c] - mean) / views;
          out.mean.push_back(mean);
          out.variance.push_back(variance);
        }
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref
