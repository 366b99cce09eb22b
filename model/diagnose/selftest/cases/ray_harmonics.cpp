#include "model/diagnose/selftest/reference/ray_harmonics.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/ray_harmonics.h"

namespace vsplat::selftest {
namespace {

void ray_harmonics_all(Checks& c) {
  for (const long r : c.some({1L, 7L, 64L, 65L, 101L}, {3L, 63L, 211L})) {
    const auto rays = random_floats(size_of(6 * r), 1, -2, 2), dout = random_floats(size_of(32 * r), 2);
    const Tensor in = c.up({r, 6}, rays), out = c.gap({r, 32}), drays = c.gap({r, 6});
    ray_harmonics_forward(c.ctx, {in, out});
    c.close("forward", out, ref::ray_harmonics(as_doubles(rays)), 1e-6);
    ray_harmonics_backward(c.ctx, {in, c.up({r, 32}, dout), drays});
    c.close(
        "backward", drays, [&] { return ref::ray_harmonics_gradient(as_doubles(rays), dout); }, c.within(1e-5, 1e-6));
  }
}

}  // namespace

VSPLAT_CASES(ray_harmonics, {"ray_harmonics", ray_harmonics_all})

}  // namespace vsplat::selftest
