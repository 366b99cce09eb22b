// Cameras around the origin, for tests.
#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "model/base/camera.h"

namespace vsplat::selftest {

// `count` square pictures of `size` pixels on a ring of the given radius, looking near (not at) the origin.
inline std::vector<Camera> orbit(int count, int size, double radius = 1.6) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double azimuth = 2 * M_PI * i / count + 0.3 * i, elevation = 0.4 * std::sin(1.7 * i + 0.2);
    const Eigen::Vector3d eye = radius * Eigen::Vector3d(std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                                                         -std::cos(elevation) * std::cos(azimuth));
    const Eigen::Vector3d forward = (Eigen::Vector3d(0.03, -0.02, 0.01 * i) - eye).normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d(0, -1, 0)).normalized();
    Eigen::Matrix3d rotation;  // world to camera: rows are the camera's axes
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    Camera c;
    c.width = c.height = size;
    c.fx = 1.05 * size, c.fy = 1.1 * size, c.cx = 0.49 * size, c.cy = 0.52 * size;
    c.w2c.topLeftCorner<3, 3>() = rotation;
    c.w2c.topRightCorner<3, 1>() = -rotation * eye;
    cameras.push_back(c);
  }
  return cameras;
}

}  // namespace vsplat::selftest
