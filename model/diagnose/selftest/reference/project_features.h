// Bilinear samples of the views at projected points, in double, from the definition.
#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "model/base/camera.h"

namespace vsplat::ref {

// Texel (row y, column x) of view v, zero outside the map.
template <class T>
double texel(const std::vector<T>& features, long t, long channels, long v, long y, long x, long c) {
  if (x < 0 || y < 0 || x >= t || y >= t) return 0;
  return features[static_cast<std::size_t>(((v * t + y) * t + x) * channels + c)];
}

// The projection of a point into a view: its position on the map of t x t texels, in texels, and its camera
// coordinates.
struct MapPosition {
  double x, y;
  Eigen::Vector3d camera;
};

inline MapPosition map_position(long t, const Camera& camera, int image, bool half_pixel,
                                const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = camera.w2c.topLeftCorner<3, 3>() * point + camera.w2c.topRightCorner<3, 1>();
  const double half = half_pixel ? 0.5 : 0;
  return {(camera.fx * p.x() / p.z() + camera.cx + half) / image * static_cast<double>(t) - 0.5,
          (camera.fy * p.y() / p.z() + camera.cy + half) / image * static_cast<double>(t) - 0.5, p};
}

// The sample of every channel of view v at `point`. -> depth along the camera's z
template <class T>
double sample_view(const std::vector<T>& features, long t, long channels, long v, const Camera& camera, int image,
                   bool half_pixel, const Eigen::Vector3d& point, std::vector<double>& out) {
  const MapPosition at = map_position(t, camera, image, half_pixel, point);
  out.assign(static_cast<std::size_t>(channels), 0);
  for (int corner = 0; corner < 4; ++corner) {
    const int right = corner % 2, down = corner / 2;
    const double cx = std::floor(at.x) + right, cy = std::floor(at.y) + down;
    const double weight = (1 - std::abs(at.x - cx)) * (1 - std::abs(at.y - cy));
    for (long c = 0; c < channels; ++c) {
      out[static_cast<std::size_t>(c)] +=
          weight * texel(features, t, channels, v, static_cast<long>(cy), static_cast<long>(cx), c);
    }
  }
  return at.camera.z();
}

// What project_features() takes.
struct ProjectFeaturesCase {
  long t = 0, channels = 0;
  std::vector<Camera> cameras;
  int image = 0;
  bool half_pixel = true, by_distance = false;
  std::vector<double> features;  // [V, t, t, C]
  std::vector<double> points;    // [P, 3]

  Eigen::Vector3d point(std::size_t p) const { return {points[3 * p], points[3 * p + 1], points[3 * p + 2]}; }
  MapPosition position(std::size_t p, std::size_t v) const {
    return map_position(t, cameras[v], image, half_pixel, point(p));
  }
  std::vector<double> sample(std::size_t p, std::size_t v) const {
    std::vector<double> out;
    sample_view(features, t, channels, static_cast<long>(v), cameras[v], image, half_pixel, point(p), out);
    return out;
  }
  // What a view's weight falls with: the camera's depth, or the distance to it.
  double remoteness(std::size_t p, std::size_t v) const {
    return by_distance ? (point(p) - cameras[v].centre()).norm() : position(p, v).camera.z();
  }
};

// [P, C]
inline std::vector<double> project_features(const ProjectFeaturesCase& in) {
  std::vector<double> result;
  for (std::size_t p = 0; 3 * p < in.points.size(); ++p) {
    std::vector<double> sum(static_cast<std::size_t>(in.channels), 0);
    double total = 0;
    for (std::size_t v = 0; v < in.cameras.size(); ++v) {
      const std::vector<double> sample = in.sample(p, v);
      const double weight = 1 / (in.remoteness(p, v) + 1e-6);
      total += weight;
      for (std::size_t c = 0; c < sample.size(); ++c) sum[c] += weight * sample[c];
    }
    for (const double s : sum) result.push_back(s / total);
  }
  return result;
}

struct ProjectFeaturesGradient {
  std::vector<double> features, points;  // shaped as those
};

// By the chain rule, for a loss whose derivative by the output is dout [P, C].
inline ProjectFeaturesGradient project_features_backward(const ProjectFeaturesCase& in,
                                                         const std::vector<float>& dout) {
  ProjectFeaturesGradient g{std::vector<double>(in.features.size()), std::vector<double>(in.points.size())};
  const auto channels = static_cast<std::size_t>(in.channels);
  const std::vector<double> out = project_features(in);
  for (std::size_t p = 0; 3 * p < in.points.size(); ++p) {
    double total = 0;
    for (std::size_t v = 0; v < in.cameras.size(); ++v) total += 1 / (in.remoteness(p, v) + 1e-6);
    for (std::size_t v = 0; v < in.cameras.size(); ++v) {
      const Camera& camera = in.cameras[v];
      const MapPosition at = in.position(p, v);
      const double depth = at.camera.z(), weight = 1 / (in.remoteness(p, v) + 1e-6), share = weight / total;
      const std::vector<double> sample = in.sample(p, v);
      double by_x = 0, by_y = 0, by_share = 0;
      for (int corner = 0; corner < 4; ++corner) {
        const int right = corner % 2, down = corner / 2;
        const double cx = std::floor(at.x) + right, cy = std::floor(at.y) + down;
        const double wx = 1 - std::abs(at.x - cx), wy = 1 - std::abs(at.y - cy);
        const auto y = static_cast<long>(cy), x = static_cast<long>(cx);
        if (y < 0 || x < 0 || y >= in.t || x >= in.t) continue;
        for (std::size_t c = 0; c < channels; ++c) {
          const std::size_t i = static_cast<std::size_t>((static_cast<long>(v) * in.t + y) * in.t + x) * channels + c;
          const double dy = share * dout[p * channels + c];
          g.features[i] += dy * wx * wy;
          by_x += dy * in.features[i] * wy * (2 * right - 1);
          by_y += dy * in.features[i] * wx * (2 * down - 1);
        }
      }
      // out = sum of weight_v sample_v / sum of weight_v.
      for (std::size_t c = 0; c < channels; ++c)
        by_share += dout[p * channels + c] * (sample[c] - out[p * channels + c]) / total;
      const Eigen::Matrix3d rotation = camera.w2c.topLeftCorner<3, 3>();
      const Eigen::Vector3d slope = in.by_distance ? Eigen::Vector3d((in.point(p) - camera.centre()).normalized())
                                                   : Eigen::Vector3d(rotation.row(2).transpose());
      const double sx = camera.fx * static_cast<double>(in.t) / in.image / depth,
                   sy = camera.fy * static_cast<double>(in.t) / in.image / depth;
      const Eigen::Vector3d by_camera(by_x * sx, by_y * sy,
                                      -(by_x * sx * at.camera.x() + by_y * sy * at.camera.y()) / depth);
      const Eigen::Vector3d by_point = rotation.transpose() * by_camera - by_share * weight * weight * slope;
      for (int i = 0; i < 3; ++i) g.points[3 * p + static_cast<std::size_t>(i)] += by_point[i];
    }
  }
  return g;
}

}  // namespace vsplat::ref
