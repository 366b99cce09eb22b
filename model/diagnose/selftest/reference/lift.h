// Lifting in double, with all samples of a voxel in memory.
#pragma once
#include "model/diagnose/selftest/reference/project_features.h"

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

// All samples [R^3, V, C].
inline std::vector<double> lift_samples(const std::vector<float>& features, long t, long channels,
                                        const std::vector<Camera>& cameras, int image, bool half_pixel, int volume) {
  std::vector<double> out, one;
  for (int voxel = 0; voxel < volume * volume * volume; ++voxel) {
    const int x = voxel / (volume * volume), y = voxel / volume % volume, z = voxel % volume;
    const Eigen::Vector3d at(x, y, z);
    for (std::size_t v = 0; v < cameras.size(); ++v) {
      sample_view(features, t, channels, static_cast<long>(v), cameras[v], image, half_pixel,
                  (at.array() + 0.5) / volume - 0.5, one);
      out.insert(out.end(), one.begin(), one.end());
    }
  }
  return out;
}

// The gradient by `features` of sum(dsamples samples): each texel's, with all its channels, by a picture that is 1
// there and 0 elsewhere.
inline std::vector<double> lift_samples_gradient(std::size_t texels, long t, long channels,
                                                 const std::vector<Camera>& cameras, int image, bool half_pixel,
                                                 int volume, const std::vector<float>& dsamples) {
  const auto c = static_cast<std::size_t>(channels);
  std::vector<double> gradient(texels * c, 0);
  for (std::size_t texel = 0; texel < texels; ++texel) {
    std::vector<float> picture(texels, 0.0f);
    picture[texel] = 1;
    const std::vector<double> weight = lift_samples(picture, t, 1, cameras, image, half_pixel, volume);
    for (std::size_t i = 0; i < dsamples.size(); ++i) gradient[texel * c + i % c] += weight[i / c] * dsamples[i];
  }
  return gradient;
}

// The gradient by `features` of sum(dmean mean + dvariance variance), both [R^3, C]. By central differences of the
// above, which are exact here: each channel's loss is a polynomial of degree two in each of its texels.
inline std::vector<double> lift_gradient(std::vector<float> features, long t, long channels,
                                         const std::vector<Camera>& cameras, int image, bool half_pixel, int volume,
                                         const std::vector<float>& dmean, const std::vector<float>& dvariance) {
  const auto c = static_cast<std::size_t>(channels);
  const auto losses = [&] {  // of each channel by itself
    const Lifted l = lift(features, t, channels, cameras, image, half_pixel, volume);
    std::vector<double> sums(c, 0);
    for (std::size_t i = 0; i < dmean.size(); ++i)
      sums[i % c] += static_cast<double>(dmean[i]) * l.mean[i] + static_cast<double>(dvariance[i]) * l.variance[i];
    return sums;
  };
  std::vector<double> gradient;
  for (std::size_t texel = 0; texel < features.size(); texel += c) {
    const std::vector<float> at(features.begin() + static_cast<long>(texel),
                                features.begin() + static_cast<long>(texel + c));
    std::vector<double> side[2];
    for (const int s : {0, 1}) {
      for (std::size_t i = 0; i < c; ++i) features[texel + i] = at[i] + (s ? 1.0f : -1.0f);
      side[s] = losses();
    }
    for (std::size_t i = 0; i < c; ++i) {
      features[texel + i] = at[i];
      gradient.push_back((side[1][i] - side[0][i]) / 2);
    }
  }
  return gradient;
}

}  // namespace vsplat::ref
