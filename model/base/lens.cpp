#include "model/base/lens.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vsplat {
namespace {

struct Value {
  double value, slope;
};

// c0 + c1 q + c2 q^2 + ... and its derivative with respect to q.
template <int N>
Value polynomial(const double (&c)[N], double q) {
  Value out{c[N - 1], 0};
  for (int i = N - 2; i >= 0; --i) {
    out.slope = out.slope * q + out.value;
    out.value = out.value * q + c[i];
  }
  return out;
}

Value opencv_numerator(const double* k, double q) { return polynomial<4>({1, k[0], k[1], k[4]}, q); }

Value opencv_denominator(const double* k, double q) { return polynomial<4>({1, k[5], k[6], k[7]}, q); }

Value fisheye_factor(const double* k, double q) { return polynomial<5>({1, k[0], k[1], k[2], k[3]}, q); }

// Whether the distorted radius increases with the undistorted radius r (opencv) or with the angle theta (fisheye).
bool grows(const Distortion& d, double r) {
  const double q = r * r;
  if (d.model == Distortion::Model::fisheye) {
    const Value f = fisheye_factor(d.k, q);
    return f.value > 0 && f.value + 2 * q * f.slope > 0;
  }
  const Value n = opencv_numerator(d.k, q), m = opencv_denominator(d.k, q);
  return m.value > 0 && n.value > 0 && (n.value + 2 * q * n.slope) * m.value - 2 * q * n.value * m.slope > 0;
}

// The first radius at which the increase ends, located to 1/4096 of the range and then refined by bisection.
double find_fold(const Distortion& d, double largest) {
  const bool fisheye = d.model == Distortion::Model::fisheye;
  const double range = fisheye ? std::atan(largest) : largest;
  constexpr int steps = 4096;
  for (int i = 1; i <= steps; ++i) {
    if (grows(d, range * i / steps)) continue;
    double low = range * (i - 1) / steps, high = range * i / steps;
    for (int k = 0; k < 40; ++k) (grows(d, 0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
    return fisheye ? std::tan(low) : low;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

bool is_pinhole(const Distortion& distortion) {
  if (distortion.model == Distortion::Model::none) return true;
  for (const double k : distortion.k)
    if (k != 0) return false;
  // A fisheye lens without parameters still distorts: theta_d = theta.
  return distortion.model == Distortion::Model::opencv;
}

bool reaches(const Distortion& d, double radius) {
  if (is_pinhole(d)) return true;
  const bool fisheye = d.model == Distortion::Model::fisheye;
  // The number of steps is fixed, because radius and coefficients may come from an untrusted file.
  constexpr int steps = 4096;
  const double most = fisheye ? std::min(M_PI / 2, 64 * radius) : 64 * radius;
  for (int i = 1; i <= steps; ++i) {
    const double r = most * i / steps;
    if (!grows(d, r)) return false;
    const double q = r * r;
    const double factor =
        fisheye ? fisheye_factor(d.k, q).value : opencv_numerator(d.k, q).value / opencv_denominator(d.k, q).value;
    if (r * factor >= radius) return true;
  }
  return false;
}

Lens::Lens(const Distortion& distortion, double largest_radius)
    : distortion_(distortion),
      fold_(is_pinhole(distortion) ? std::numeric_limits<double>::infinity() : find_fold(distortion, largest_radius)) {}

bool Lens::distort(double x, double y, double& distorted_x, double& distorted_y) const {
  const double* k = distortion_.k;
  const double q = x * x + y * y;
  distorted_x = x;
  distorted_y = y;
  if (distortion_.model == Distortion::Model::none) return true;
  if (!(std::sqrt(q) < fold_)) return false;
  if (distortion_.model == Distortion::Model::fisheye) {
    const double r = std::sqrt(q), theta = std::atan(r);
    const double scale = (r > 1e-12 ? theta / r : 1.0) * fisheye_factor(k, theta * theta).value;
    distorted_x = x * scale;
    distorted_y = y * scale;
    return true;
  }
  const double radial = opencv_numerator(k, q).value / opencv_denominator(k, q).value;
  distorted_x = x * radial + 2 * k[2] * x * y + k[3] * (q + 2 * x * x);
  distorted_y = y * radial + k[2] * (q + 2 * y * y) + 2 * k[3] * x * y;
  return true;
}

}  // namespace vsplat
