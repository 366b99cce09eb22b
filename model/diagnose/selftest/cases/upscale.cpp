#include "model/diagnose/selftest/reference/upscale.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/upscale.h"

namespace vsplat::selftest {
namespace {

void upscale_all(Checks& c) {
  struct Try {
    long p, f, n, channels;
    double reach = 0.02, unit = 50;
  };
  for (const Try& t :
       c.some({Try{1, 1, 1, 1}, {3, 2, 2, 5}, {7, 4, 3, 16}, {65, 2, 1, 3}}, {{1, 1, 0, 1, 1.0 / 64, 1},
                                                                              {3, 2, 6, 7, 1.0 / 64, 1},
                                                                              {7, 4, 3, 31, 1.0 / 64, 2},
                                                                              {13, 2, 8, 33, 1.0 / 64, 2}})) {
    const long wide = 6 * t.n + t.channels;
    const auto raw = random_floats(size_of(3 * t.p, t.f), 1, -2, 2), points = random_floats(size_of(3 * t.p), 2),
               feature = random_floats(size_of(t.p, t.channels), 3),
               dchildren = random_floats(size_of(3 * t.p, t.f), 4), dwide = random_floats(size_of(t.p * t.f, wide), 5),
               before = random_floats(feature.size(), 6);
    const double reach = t.reach, unit = t.unit;
    const ref::UpscaleCase want{size_of(t.f), size_of(t.n),    size_of(t.channels), reach,
                                unit,         as_doubles(raw), as_doubles(points),  as_doubles(feature)};
    const Tensor in = c.up({t.p, 3 * t.f}, raw), children = c.gap({t.p * t.f, 3}), offsets = c.gap({t.p * t.f, 3}),
                 out = c.gap({t.p * t.f, wide});
    upscale_forward(c.ctx, {in, c.up({t.p, 3}, points), c.up({t.p, t.channels}, feature), t.n, reach, unit, children,
                            offsets, out});
    const auto there = want.forward();
    c.close("children", children, there.children, 1e-6);
    c.close("offsets", offsets, there.offsets, 1e-6);
    c.close("waves and features", out, there.wide, 1e-5);
    const Tensor draw = c.gap({t.p, 3 * t.f}), dpoints = c.gap({t.p, 3}), dfeature = c.up({t.p, t.channels}, before);
    upscale_backward(c.ctx, {in, t.n, reach, unit, c.up({t.p * t.f, 3}, dchildren), c.up({t.p * t.f, wide}, dwide),
                             draw, dpoints, dfeature});
    c.close(
        "backward, draw", draw, [&] { return want.gradient(&ref::UpscaleCase::raw, dchildren, dwide); }, 2e-5);
    c.close(
        "backward, dpoints", dpoints, [&] { return want.gradient(&ref::UpscaleCase::points, dchildren, dwide); }, 1e-5);
    c.close(
        "backward, dfeature", dfeature,
        [&] {
          auto sums = want.gradient(&ref::UpscaleCase::feature, dchildren, dwide);
          for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
          return sums;
        },
        1e-5);
  }
}

}  // namespace

VSPLAT_CASES(upscale, {"upscale", upscale_all})

}  // namespace vsplat::selftest
