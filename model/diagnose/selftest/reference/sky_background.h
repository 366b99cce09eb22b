// A sky of spherical harmonics behind a picture, in double: real harmonics from associated Legendre functions in the
// angles of a direction, not from polynomials in its coordinates.
#pragma once
#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "model/base/camera.h"

namespace vsplat::ref {

// (-1)^m times the associated Legendre function P_l^m(t) with the Condon-Shortley sign, by its recurrence in l.
inline double legendre(int l, int m, double t) {
  double below = 0, here = 1;  // of m - 1 (zero) and m
  for (int i = 1; i <= m; ++i) here *= (2 * i - 1) * std::sqrt(1 - t * t);
  for (int n = m + 1; n <= l; ++n) {
    const double next = ((2 * n - 1) * t * here - (n + m - 1) * below) / (n - m);
    below = here;
    here = next;
  }
  return here;
}

// Real harmonics up to degree 4 for a unit direction, with the sign (-1)^m as in 3DGS files: 25 values.
inline std::vector<double> sky_basis(const Eigen::Vector3d& d) {
  const double azimuth = std::atan2(d.y(), d.x());
  std::vector<double> out;
  for (int l = 0; l <= 4; ++l)
    for (int m = -l; m <= l; ++m) {
      const int a = std::abs(m);
      double ratio = 1;  // (l - a)! / (l + a)!
      for (int i = l - a + 1; i <= l + a; ++i) ratio /= i;
      const double wave =
          m == 0 ? 1 : std::sqrt(2.0) * (a % 2 ? -1 : 1) * (m < 0 ? std::sin(a * azimuth) : std::cos(a * azimuth));
      out.push_back(std::sqrt((2 * l + 1) / (4 * M_PI) * ratio) * legendre(l, a, d.z()) * wave);
    }
  return out;
}

// The sky's colours seen by a camera's pixels: sh [25,3] -> [H,W,3].
inline std::vector<double> sky(const std::vector<double>& sh, const Camera& camera) {
  std::vector<double> out;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1);
      const auto basis = sky_basis((camera.w2c.topLeftCorner<3, 3>().transpose() * ray).normalized());
      for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0.5;
        for (std::size_t k = 0; k < 25; ++k) sum += basis[k] * sh[3 * k + c];
        out.push_back(sum);
      }
    }
  return out;
}

// colour [P,3] over black and alpha [P] -> [P,3] over the sky.
inline std::vector<double> over_sky(const std::vector<double>& sh, const Camera& camera,
                                    const std::vector<double>& colour, const std::vector<double>& alpha) {
  std::vector<double> out = sky(sh, camera);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = colour[i] + (1 - alpha[i / 3]) * out[i];
  return out;
}

}  // namespace vsplat::ref
