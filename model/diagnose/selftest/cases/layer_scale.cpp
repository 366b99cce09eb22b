#include "model/diagnose/selftest/reference/layer_scale.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/layer_scale.h"

namespace vsplat::selftest {
namespace {

void layer_scale_all(Checks& c) {
  for (const auto& [n, k] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {7, 63}, {5, 64}, {13, 131}}, {{2, 65}})) {
    const std::size_t rows = size_of(n), all = size_of(n, k);
    const auto w = random_floats(all, 1), b = random_floats(rows, 2), s = random_floats(rows, 3),
               dw = random_floats(all, 4), db = random_floats(rows, 5);
    const ref::LayerScaleCase want{as_doubles(w), as_doubles(b), as_doubles(s)};
    const LayerScaleForward f{c.up({n, k}, w), c.up({n}, b), c.up({n}, s), c.gap({n, k}), c.gap({n})};
    layer_scale_forward(c.ctx, f);
    auto got = c.ctx.read<float>(f.out_weight);
    const auto bias = c.ctx.read<float>(f.out_bias);
    got.insert(got.end(), bias.begin(), bias.end());
    c.close("forward", got, want.forward(), 1e-6);
    const LayerScaleBackward g{f.weight,      f.bias,          f.scale,      c.up({n, k}, dw),
                               c.up({n}, db), c.up({n, k}, w), c.up({n}, b), c.up({n}, s)};
    layer_scale_backward(c.ctx, g);
    std::vector<float> dy = dw;
    dy.insert(dy.end(), db.begin(), db.end());
    c.close(
        "backward, dweight", g.dweight, [&] { return plus(want.gradient(&ref::LayerScaleCase::w, dy), w); }, 1e-5);
    c.close(
        "backward, dbias", g.dbias, [&] { return plus(want.gradient(&ref::LayerScaleCase::b, dy), b); }, 1e-5);
    c.close(
        "backward, dscale", g.dscale, [&] { return plus(want.gradient(&ref::LayerScaleCase::s, dy), s); }, 1e-5);
  }
}

}  // namespace

VSPLAT_CASES(layer_scale, {"layer_scale", layer_scale_all})

}  // namespace vsplat::selftest
