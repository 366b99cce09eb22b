#include "model/diagnose/selftest/reference/exposure.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/loss.h"
#include "model/ops/fit/exposure.h"
#include "model/ops/render/rasterize.h"

namespace vsplat::selftest {
namespace {

void exposure_all(Checks& c) {
  for (const auto& [h, w] :
       c.some({std::array<long, 2>{1, 1}, {1, 7}, {5, 11}, {16, 16}, {1, 257}}, {{5, 51}, {31, 33}})) {
    const std::size_t n = size_of(h, w);
    const auto map = random_floats(12, 1), colour = random_floats(3 * n, 2, -0.5f, 1.5f),
               alpha = random_floats(n, 3, 0, 1), by = random_floats(3 * n, 4), dalpha = random_floats(n, 5);
    const DevicePicture drawn{c.up({h, w, 3}, colour), c.up({h, w}, alpha), {}};
    const Tensor m = c.up({12}, map), out = c.gap({h, w, 3}), dmap = c.gap({12});
    exposure_forward(c.ctx, {m, drawn, kBehindPictures, out});
    const std::array<double, 3> behind{kBehindPictures[0], kBehindPictures[1], kBehindPictures[2]};
    auto dm = as_doubles(map), dc = as_doubles(colour), da = as_doubles(alpha);
    c.close("forward", out, ref::exposure(dm, dc, da, behind), 1e-6);
    const PictureGradient to{c.up({h, w, 3}, by), c.up({h, w}, dalpha), {}};
    exposure_backward(c.ctx, {m, drawn, kBehindPictures, to, dmap});
    const auto value = [&] { return ref::weighed(ref::exposure(dm, dc, da, behind), by); };
    c.close(
        "backward, dmap", dmap, [&] { return ref::central_differences(dm, 1, value); }, 2e-6);
    c.close(
        "backward, colour", to.colour, [&] { return ref::central_differences(dc, 1, value); }, 2e-6);
    c.close(
        "backward, alpha", to.alpha,
        [&] {
          auto sums = ref::central_differences(da, 1, value);
          for (std::size_t i = 0; i < n; ++i) sums[i] += dalpha[i];
          return sums;
        },
        2e-6);
  }
}

}  // namespace

VSPLAT_CASES(exposure, {"exposure", exposure_all})

}  // namespace vsplat::selftest
