#include "model/data/bodies.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace vsplat {
namespace {

using Eigen::Vector3d;

double signed_power(double x, double exponent) { return std::copysign(std::pow(std::abs(x), exponent), x); }

}  // namespace

Body superellipsoid(double upright, double round) {
  const auto surface = [=](double u, double v) {
    const double a = 2 * M_PI * u, b = M_PI * (v - 0.5);
    const double level = v <= 0 || v >= 1 ? 0.0 : signed_power(std::cos(b), upright);
    return Vector3d(level * signed_power(std::cos(a), round), signed_power(std::sin(b), upright),
                    level * signed_power(std::sin(a), round));
  };
  const auto inside = [=](const Vector3d& p) {
    const double level = std::pow(std::abs(p.x()), 2 / round) + std::pow(std::abs(p.z()), 2 / round);
    return std::pow(level, round / upright) + std::pow(std::abs(p.y()), 2 / upright) - 1;
  };
  return {surface, inside};
}

Body ring(double thickness) {
  const auto surface = [=](double u, double v) {
    const double a = 2 * M_PI * u, b = v < 1 ? 2 * M_PI * v : 0.0, r = 1 - thickness + thickness * std::cos(b);
    return Vector3d(r * std::cos(a), thickness * std::sin(b), r * std::sin(a));
  };
  const auto inside = [=](const Vector3d& p) {
    return std::hypot(std::hypot(p.x(), p.z()) - (1 - thickness), p.y()) - thickness;
  };
  return {surface, inside};
}

Body vase(Random& random) {
  std::array<double, 3> wave{}, phase{};
  for (int k = 0; k < 3; ++k) wave[k] = random.uniform(0.05, 0.25), phase[k] = random.uniform(0, 2 * M_PI);
  const auto profile = [=](double v) {
    double r = 0.55;
    for (int k = 0; k < 3; ++k) r += wave[k] / (k + 1) * std::sin(2 * (k + 1) * v * M_PI + phase[k]);
    return r;
  };
  const auto surface = [=](double u, double v) {
    const double r = v <= 0 || v >= 1 ? 0.0 : profile(v), a = 2 * M_PI * u;
    return Vector3d(r * std::cos(a), 2 * v - 1, r * std::sin(a));
  };
  const auto inside = [=](const Vector3d& p) {
    const double r = profile(std::clamp(0.5 * (p.y() + 1), 0.0, 1.0));
    return std::max(std::hypot(p.x(), p.z()) - r, std::abs(p.y()) - 1);
  };
  return {surface, inside};
}

Body random_body(Random& random) {
  switch (random.below(6)) {
    case 0:
      return superellipsoid(0.15, 0.15);  // a box
    case 1:
      return superellipsoid(0.1, 1.0);  // a cylinder
    case 2:
      return superellipsoid(1.0, 1.0);  // a ball
    case 3:
      return ring(random.uniform(0.2, 0.45));
    case 4:
      return vase(random);
    default: {
      const double round = random.uniform(0.3, 1.8), upright = random.uniform(0.3, 1.8);
      return superellipsoid(upright, round);
    }
  }
}

Eigen::Matrix3d random_rotation(Random& random) {
  const double a = random.uniform(), b = random.uniform(0, 2 * M_PI), c = random.uniform(0, 2 * M_PI);
  return Eigen::Quaterniond(std::sqrt(a) * std::cos(c), std::sqrt(1 - a) * std::sin(b), std::sqrt(1 - a) * std::cos(b),
                            std::sqrt(a) * std::sin(c))
      .normalized()
      .toRotationMatrix();
}

}  // namespace vsplat
