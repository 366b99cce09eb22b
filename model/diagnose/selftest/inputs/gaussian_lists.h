// Gaussians on the device to be written, and derivatives by them.
#pragma once
#include "model/base/gaussians.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/decode.h"

namespace vsplat::selftest {

inline DeviceGaussians gap_gaussians(Context& ctx, long n, long s, long scales = 3) {
  const auto gap = [&](const Shape& shape, long each) { return ctx.upload(shape, nans(size_of(n, each))); };
  return {gap({n, 3}, 3), gap({n, scales}, scales), gap({n, 4}, 4), gap({n}, 1), gap({n, s, 3}, 3 * s)};
}

// A loss that is linear in every Gaussian: its derivatives.
inline ref::GaussianLists slopes(long n, long s, long scales = 3) {
  return {random_doubles(size_of(3 * n), 51), random_doubles(size_of(scales * n), 52),
          random_doubles(size_of(4 * n), 53), random_doubles(size_of(n), 54), random_doubles(size_of(3 * s * n), 55)};
}

inline GaussianGradients up_slopes(Context& ctx, const ref::GaussianLists& g, long n, long s, long scales = 3) {
  return {ctx.upload({n, 3}, as_floats(g.means)), ctx.upload({n, scales}, as_floats(g.scales)),
          ctx.upload({n, 4}, as_floats(g.quats)), ctx.upload({n}, as_floats(g.opacities)),
          ctx.upload({n, s, 3}, as_floats(g.sh))};
}

}  // namespace vsplat::selftest
