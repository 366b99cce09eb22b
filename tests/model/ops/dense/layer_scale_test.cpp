#include "model/ops/dense/layer_scale.h"

#include <fmt/format.h>

#include "model/diagnose/selftest/reference/layer_scale.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class LayerScale : public test::FlavourTest {};
VSPLAT_FLAVOURS(LayerScale);

TEST_P(LayerScale, MatchesReferenceAndItsDifferences) {
  for (const auto& [n, k] : {std::pair{1L, 1L}, {3L, 7L}, {7L, 63L}, {5L, 64L}, {2L, 65L}, {13L, 131L}}) {
    SCOPED_TRACE(fmt::format("{} x {}", n, k));
    const auto rows = static_cast<std::size_t>(n), all = rows * static_cast<std::size_t>(k);
    const auto w = test::random_floats(all, 1), b = test::random_floats(rows, 2), s = test::random_floats(rows, 3);
    const ref::LayerScaleCase want{{w.begin(), w.end()}, {b.begin(), b.end()}, {s.begin(), s.end()}};
    LayerScaleForward f{ctx().upload({n, k}, w), ctx().upload({n}, b), ctx().upload({n}, s),
                        ctx().upload({n, k}, test::nans(all)), ctx().upload({n}, test::nans(rows))};
    layer_scale_forward(ctx(), f);
    auto got = ctx().read<float>(f.out_weight);
    const auto bias = ctx().read<float>(f.out_bias);
    got.insert(got.end(), bias.begin(), bias.end());
    EXPECT_TRUE(test::close(got, want.forward(), 1e-6));

    const auto dy = test::random_floats(all + rows, 4);
    const auto ends = dy.begin() + static_cast<std::ptrdiff_t>(all);
    const LayerScaleBackward g{f.weight,
                               f.bias,
                               f.scale,
                               ctx().upload({n, k}, std::vector<float>(dy.begin(), ends)),
                               ctx().upload({n}, std::vector<float>(ends, dy.end())),
                               ctx().upload({n, k}, w),
                               ctx().upload({n}, b),
                               ctx().upload({n}, s)};
    layer_scale_backward(ctx(), g);
    const auto expect = [&](const Tensor& sum, const std::vector<float>& before,
                            std::vector<double> ref::LayerScaleCase::*by) {
      auto with = want.gradient(by, dy);
      for (std::size_t i = 0; i < with.size(); ++i) with[i] += before[i];
      EXPECT_TRUE(test::close(ctx().read<float>(sum), with, 1e-5));
    };
    expect(g.dweight, w, &ref::LayerScaleCase::w);
    expect(g.dbias, b, &ref::LayerScaleCase::b);
    expect(g.dscale, s, &ref::LayerScaleCase::s);
  }
}

TEST_P(LayerScale, EmptyAndBadShape) {
  const Tensor none = ctx().tensor({0}), empty = ctx().tensor({0, 3}), w = ctx().tensor({2, 3}), b = ctx().tensor({2});
  layer_scale_forward(ctx(), {empty, none, none, empty, none});
  EXPECT_THROW(layer_scale_forward(ctx(), {w, b, ctx().tensor({3}), w, b}), Error);
  EXPECT_THROW(layer_scale_backward(ctx(), {w, b, b, w, b, w, b, ctx().tensor({3})}), Error);
}

}  // namespace
}  // namespace vsplat
