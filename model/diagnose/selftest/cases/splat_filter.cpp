#include "model/ops/fit/splat_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/ops/render/project.h"

namespace vsplat::selftest {
namespace {

constexpr double kFilterNear = 0.2;

// The variance in double; nothing if the middle is so near a limit of what a camera sees that floats may differ.
std::optional<double> variance_of(const Eigen::Vector3d& mean, const std::vector<Camera>& cameras) {
  double nu = 0;
  for (const Camera& c : cameras) {
    const Eigen::Vector3d p = (c.w2c * mean.homogeneous()).head<3>();
    const double u = (c.fx * p.x() / p.z() + c.cx) / c.width, v = (c.fy * p.y() / p.z() + c.cy) / c.height;
    const double beside = std::max(std::abs(u - 0.5), std::abs(v - 0.5)) - 0.65;
    if (std::abs(p.z() - kFilterNear) < 1e-4 || std::abs(beside) < 1e-4) return {};
    if (p.z() > kFilterNear && beside < 0) nu = std::max(nu, std::max(c.fx, c.fy) / p.z());
  }
  return nu > 0 ? 0.04 / (nu * nu) : 0;
}

void variances_of(Checks& c, std::size_t count, int views) {
  // Around the ring of cameras, and behind each of them.
  std::vector<float> means = random_floats(3 * count, 3, -2.5f, 2.5f);
  const std::vector<Camera> cameras = orbit(views, 50);
  std::vector<double> want;
  for (std::size_t k = 0; k < count; ++k) {
    std::optional<double> v;
    while (!(v = variance_of(Eigen::Map<const Eigen::Vector3f>(&means[3 * k]).cast<double>(), cameras)))
      means[3 * k] += 0.01f;
    want.push_back(*v);
  }
  const long k = static_cast<long>(count);
  const SplatFilterVariances a{c.up({k, 3}, means), upload_views(c.ctx, cameras, static_cast<float>(kFilterNear), {}),
                               c.gap({k})};
  splat_filter_variances(c.ctx, a);
  c.close("variances", a.variances, want, 1e-5);
}

// A loss that is linear in what is filtered.
struct FilterLoss {
  double variance;
  std::array<double, 3> by_scale;
  double by_opacity;

  double operator()(const std::array<double, 4>& x) const {
    double sum = 0, opacity = x[3];
    for (std::size_t i = 0; i < 3; ++i) {
      const double filtered = std::sqrt(x[i] * x[i] + variance);
      sum += by_scale[i] * filtered;
      opacity *= x[i] / filtered;
    }
    return sum + by_opacity * opacity;
  }
};

void filter_of(Checks& c, std::size_t count) {
  const long n = static_cast<long>(count);
  const auto log_scales = random_floats(3 * count, 1, -6, 0), opacities = random_floats(count, 2, 0, 1),
             by_scales = random_floats(3 * count, 4), by_opacities = random_floats(count, 5);
  auto variances = random_floats(count, 3, 0, 0.01f);
  if (count > 2) variances[count / 2] = 0;
  std::vector<float> scales;
  scales.reserve(log_scales.size());
  std::vector<double> want_scales, want_opacities, want_dscales, want_dopacities;
  for (const float x : log_scales) scales.push_back(std::exp(x));
  for (std::size_t k = 0; k < count; ++k) {
    const double v = static_cast<double>(variances[k]);
    std::array<double, 4> x{};
    FilterLoss loss{v, {}, static_cast<double>(by_opacities[k])};
    x[3] = static_cast<double>(opacities[k]);
    double opacity = x[3];
    for (std::size_t i = 0; i < 3; ++i) {
      x[i] = std::exp(static_cast<double>(log_scales[3 * k + i]));
      loss.by_scale[i] = static_cast<double>(by_scales[3 * k + i]);
      want_scales.push_back(std::sqrt(x[i] * x[i] + v));
      opacity *= x[i] / want_scales.back();
    }
    want_opacities.push_back(opacity);
    for (std::size_t i = 0; i < 4; ++i)
      (i < 3 ? want_dscales : want_dopacities).push_back(ref::derivative_by(x[i], 1e-3 * x[i], [&] {
        return loss(x);
      }));
  }
  const SplatFilterForward f{c.up({n}, variances), c.up({n, 3}, scales), c.up({n}, opacities)};
  splat_filter_forward(c.ctx, f);
  c.close("scales", f.scales, want_scales, 1e-6);
  c.close("opacities", f.opacities, want_opacities, 1e-6);
  const SplatFilterBackward b{f.variances, c.up({n, 3}, log_scales), f.opacities, c.up({n, 3}, by_scales),
                              c.up({n}, by_opacities)};
  splat_filter_backward(c.ctx, b);
  c.close("backward, scales", b.dscales, want_dscales, 1e-5);
  c.close("backward, opacities", b.dopacities, want_dopacities, 1e-5);
}

void splat_filter_all(Checks& c) {
  for (const std::size_t count : c.some({3UL, 1009UL}, {0UL, 1UL, 7UL, 63UL, 64UL, 65UL})) {
    variances_of(c, count, 5);
    filter_of(c, count);
  }
  if (c.all) variances_of(c, 65, 1);
}

}  // namespace

VSPLAT_CASES(splat_filter, {"splat_filter", splat_filter_all})

}  // namespace vsplat::selftest
