// Rays through patch centres in double, and spherical harmonics by another road than the kernel's: associated Legendre
// polynomials.
#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "model/base/camera.h"

namespace vsplat::ref {

// Unit direction and moment of the ray through pixel (x, y).
inline void plucker(const Camera& camera, double x, double y, Eigen::Vector3d& direction, Eigen::Vector3d& moment) {
  Eigen::Matrix3d k;
  k << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  direction = (camera.w2c.topLeftCorner<3, 3>().inverse() * k.inverse() * Eigen::Vector3d(x, y, 1)).normalized();
  moment = camera.centre().cross(direction);
}

// Real spherical harmonics to degree 3 as the model's polynomials have them: (x + i y)^m turns about z, and the part in
// z is the m-th derivative of the Legendre polynomial, not made homogeneous (off the unit sphere that matters), with
// the Condon-Shortley sign.
inline std::vector<double> real_sh3(const Eigen::Vector3d& p) {
  const double x = p.x(), y = p.y(), z = p.z();
  // d^m P_n / dz^m
  const double legendre[4][4] = {{1, 0, 0, 0},
                                 {z, 1, 0, 0},
                                 {0.5 * (3 * z * z - 1), 3 * z, 3, 0},
                                 {0.5 * (5 * z * z * z - 3 * z), 0.5 * (15 * z * z - 3), 15 * z, 15}};
  const double re[4] = {1, x, x * x - y * y, x * x * x - 3 * x * y * y};
  const double im[4] = {0, y, 2 * x * y, 3 * x * x * y - y * y * y};
  const double factorial[7] = {1, 1, 2, 6, 24, 120, 720};
  std::vector<double> out;
  for (int n = 0; n < 4; ++n) {
    for (int m = -n; m <= n; ++m) {
      const int a = std::abs(m);
      double norm = std::sqrt((2 * n + 1) / (4 * M_PI) * factorial[n - a] / factorial[n + a]);
      if (m != 0) norm *= std::sqrt(2.0) * (a % 2 ? -1 : 1);
      out.push_back(norm * legendre[n][a] * (m < 0 ? im[a] : re[a]));
    }
  }
  return out;
}

}  // namespace vsplat::ref
