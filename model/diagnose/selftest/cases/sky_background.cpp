#include "model/diagnose/selftest/reference/sky_background.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/ops/fit/sky_background.h"

namespace vsplat::selftest {
namespace {

void sky_background_all(Checks& c) {
  for (const auto& [h, w] :
       c.some({std::array<long, 2>{1, 1}, {1, 7}, {5, 11}, {16, 16}, {1, 257}}, {{0, 3}, {3, 1}, {5, 51}, {31, 33}})) {
    const std::size_t n = size_of(h, w);
    Camera camera = orbit(5, 16).at(static_cast<std::size_t>((h + w) % 5));
    camera.width = static_cast<int>(w), camera.height = static_cast<int>(h);
    camera.cx = 0.4 * camera.width, camera.cy = 0.7 * camera.height;
    const auto sh = random_floats(75, 1), colour = random_floats(3 * n, 2, 0, 1), alpha = random_floats(n, 3, 0, 1),
               by = random_floats(3 * n, 4), dalpha = random_floats(n, 5);
    std::vector<float> numbers(32);
    for (int i = 0; i < 9; ++i) numbers[static_cast<std::size_t>(i)] = static_cast<float>(camera.w2c(i / 3, i % 3));
    numbers[15] = static_cast<float>(camera.fx), numbers[16] = static_cast<float>(camera.fy);
    numbers[17] = static_cast<float>(camera.cx), numbers[18] = static_cast<float>(camera.cy);
    const DevicePicture drawn{c.up({h, w, 3}, colour), c.up({h, w}, alpha), {}};
    const Tensor x = c.up({25, 3}, sh), view = c.up({1, 32}, numbers), out = c.gap({h, w, 3}), dsh = c.gap({25, 3});
    sky_background_forward(c.ctx, {x, view, drawn, out});
    auto dx = as_doubles(sh), da = as_doubles(alpha);
    const auto dc = as_doubles(colour);
    c.close("forward", out, ref::over_sky(dx, camera, dc, da), 2e-6);
    const PictureGradient to{c.up({h, w, 3}, by), c.up({h, w}, dalpha), {}};
    sky_background_backward(c.ctx, {x, view, drawn, to, dsh});
    const auto value = [&] { return ref::weighed(ref::over_sky(dx, camera, dc, da), by); };
    c.close(
        "backward, coefficients", dsh, [&] { return ref::central_differences(dx, 1, value); }, 1e-5);
    c.close(
        "backward, alpha", to.alpha,
        [&] {
          auto sums = ref::central_differences(da, 1, value);
          for (std::size_t i = 0; i < n; ++i) sums[i] += dalpha[i];
          return sums;
        },
        2e-6);
    c.equal("backward, colour stays", to.colour, by);
  }
}

}  // namespace

VSPLAT_CASES(sky_background, {"sky_background", sky_background_all})

}  // namespace vsplat::selftest
