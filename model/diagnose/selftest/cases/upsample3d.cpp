#include "model/diagnose/selftest/reference/upsample3d.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/volume/upsample3d.h"

namespace vsplat::selftest {
namespace {

void upsample3d_all(Checks& c) {
  struct Try {
    long d, h, w, channels;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 3}, {3, 2, 1, 7}, {2, 3, 4, 16}, {3, 3, 3, 17}, {2, 5, 3, 33}},
                             {{1, 1, 1, 1}, {1, 2, 3, 5}, {3, 2, 5, 19}, {4, 4, 4, 33}, {2, 2, 2, 130}})) {
    const long n = t.d * t.h * t.w;
    const auto x = random_floats(size_of(n, t.channels), 1), dy = random_floats(size_of(8 * n, t.channels), 2);
    const Tensor y = c.gap({8 * n, t.channels}), dx = c.gap({n, t.channels});
    upsample3d_forward(c.ctx, {c.up({n, t.channels}, x), t.d, t.h, t.w, y});
    c.close("forward", y, ref::upsample3d(x, t.d, t.h, t.w, t.channels), 1e-6);
    upsample3d_backward(c.ctx, {c.up({8 * n, t.channels}, dy), t.d, t.h, t.w, dx, false});
    c.close(
        "backward", dx, [&] { return ref::upsample3d_backward(dy, t.d, t.h, t.w, t.channels); }, 1e-6);
    if (!c.all) continue;
    const auto before = random_floats(x.size(), 3);
    const Tensor sums = c.up(dx.shape(), before);
    upsample3d_backward(c.ctx, {c.up(y.shape(), dy), t.d, t.h, t.w, sums, true});
    c.close(
        "backward, added", sums, [&] { return plus(ref::upsample3d_backward(dy, t.d, t.h, t.w, t.channels), before); },
        1e-6);
  }
}

}  // namespace

VSPLAT_CASES(upsample3d, {"upsample3d", upsample3d_all})

}  // namespace vsplat::selftest
