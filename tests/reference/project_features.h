// Bilinear samples of the views at projected points, in double, from the definition.
#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "model/camera.h"

namespace vsplat::ref {

// Texel (row y, column x) of view v, zero outside the map.
inline double texel(const std::vector<float>& features, long t, long channels, long v, long y, long x, long c) {
  if (x < 0 || y < 0 || x >= t || y >= t) return 0;
  return features[static_cast<std::size_t>(((v * t + y) * t + x) * channels + c)];
}

// The sample of every channel of view v at `point`. -> depth along the camera's z
inline double sample_view(const std::vector<float>& features, long t, long channels, long v, const Camera& camera,
                          int image, bool half_pixel, const Eigen::Vector3d& point, std::vector<double>& out) {
  const Eigen::Vector3d p = camera.w2c.topLeftCorner<3, 3>() * point + camera.w2c.topRightCorner<3, 1>();
  const double half = half_pixel ? 0.5 : 0;
  const double x = (camera.fx * p.x() / p.z() + camera.cx + half) / image * static_cast<double>(t) - 0.5;
  const double y = (camera.fy * p.y() / p.z() + camera.cy + half) / image * static_cast<double>(t) - 0.5;
  out.assign(static_cast<std::size_t>(channels), 0);
  for (int corner = 0; corner < 4; ++corner) {
    const double cx = std::floor(x) + corner % 2, cy = std::floor(y) + corner / 2;
    const double weight = (1 - std::abs(x - cx)) * (1 - std::abs(y - cy));
    for (long c = 0; c < channels; ++c) {
      out[static_cast<std::size_t>(c)] +=
          weight * texel(features, t, channels, v, static_cast<long>(cy), static_cast<long>(cx), c);
    }
  }
  return p.z();
}

inline std::vector<double> project_features(const std::vector<float>& features, long t, long channels,
                                            const std::vector<Camera>& cameras, int image, bool half_pixel,
                                            bool by_distance, const std::vector<float>& points) {
  std::vector<double> result;
  for (std::size_t i = 0; i < points.size(); i += 3) {
    const Eigen::Vector3d point(points[i], points[i + 1], points[i + 2]);
    std::vector<double> sum(static_cast<std::size_t>(channels), 0), sample;
    double total = 0;
    for (std::size_t v = 0; v < cameras.size(); ++v) {
      const double depth =
          sample_view(features, t, channels, static_cast<long>(v), cameras[v], image, half_pixel, point, sample);
      const double weight = 1 / ((by_distance ? (point - cameras[v].centre()).norm() : depth) + 1e-6);
      total += weight;
      for (std::size_t c = 0; c < sample.size(); ++c) sum[c] += weight * sample[c];
    }
    for (const double s : sum) result.push_back(s / total);
  }
  return result;
}

}  // namespace vsplat::ref
