#include "model/ops/networks/upscale.h"

#include "model/diagnose/selftest/reference/upscale.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Upscale : public test::FlavourTest {
 protected:
  void check(long p, long f, long n, long c, double unit) {
    SCOPED_TRACE(std::to_string(p) + " x " + std::to_string(f) + ", " + std::to_string(n) + " waves, " +
                 std::to_string(c) + " channels");
    const auto count = [](long v) { return static_cast<std::size_t>(v); };
    const auto raw = test::random_floats(count(3 * p * f), 1, -2, 2), points = test::random_floats(count(3 * p), 2),
               feature = test::random_floats(count(p * c), 3);
    ref::UpscaleCase want;
    want.f = count(f), want.n = count(n), want.c = count(c), want.reach = 1.0 / 64, want.unit = unit;
    want.raw.assign(raw.begin(), raw.end()), want.points.assign(points.begin(), points.end());
    want.feature.assign(feature.begin(), feature.end());
    const long children = p * f, width = 6 * n + c;
    const auto gap = [&](const Shape& shape, long size) { return ctx().upload(shape, test::nans(count(size))); };
    const Tensor on_device = ctx().upload({p, 3 * f}, raw);
    const UpscaleForward a{on_device,
                           ctx().upload({p, 3}, points),
                           ctx().upload({p, c}, feature),
                           n,
                           want.reach,
                           unit,
                           gap({children, 3}, 3 * children),
                           gap({children, 3}, 3 * children),
                           gap({children, width}, children * width)};
    upscale_forward(ctx(), a);
    const ref::UpscaleCase::Result result = want.forward();
    EXPECT_TRUE(test::close(ctx().read<float>(a.children), result.children, 1e-6));
    EXPECT_TRUE(test::close(ctx().read<float>(a.offsets), result.offsets, 1e-6));
    EXPECT_TRUE(test::close(ctx().read<float>(a.wide), result.wide, 1e-5));

    const auto dchildren = test::random_floats(count(3 * children), 4),
               dwide = test::random_floats(count(children * width), 5), before = test::random_floats(count(p * c), 6);
    const UpscaleBackward b{on_device,
                            n,
                            want.reach,
                            unit,
                            ctx().upload({children, 3}, dchildren),
                            ctx().upload({children, width}, dwide),
                            gap({p, 3 * f}, 3 * children),
                            gap({p, 3}, 3 * p),
                            ctx().upload({p, c}, before)};
    upscale_backward(ctx(), b);
    EXPECT_TRUE(test::close(ctx().read<float>(b.draw), want.gradient(&ref::UpscaleCase::raw, dchildren, dwide), 2e-5));
    EXPECT_TRUE(
        test::close(ctx().read<float>(b.dpoints), want.gradient(&ref::UpscaleCase::points, dchildren, dwide), 1e-5));
    auto by_feature = want.gradient(&ref::UpscaleCase::feature, dchildren, dwide);
    for (std::size_t i = 0; i < before.size(); ++i) by_feature[i] += before[i];
    EXPECT_TRUE(test::close(ctx().read<float>(b.dfeature), by_feature, 1e-5));
  }
};
VSPLAT_FLAVOURS(Upscale);
VSPLAT_OPERATION(Upscale, upscale)

TEST_P(Upscale, MatchesReference) {
  check(1, 1, 0, 1, 1);
  check(3, 2, 6, 7, 1);
  check(7, 4, 3, 31, 2);
  check(13, 2, 8, 33, 2);
}

TEST_P(Upscale, NoPoints) {
  const Tensor none = ctx().tensor({0, 3}), wide = ctx().tensor({0, 11});
  upscale_forward(ctx(), {ctx().tensor({0, 6}), none, ctx().tensor({0, 5}), 1, 1, 1, none, none, wide});
  upscale_backward(ctx(),
                   {ctx().tensor({0, 6}), 1, 1, 1, none, wide, ctx().tensor({0, 6}), none, ctx().tensor({0, 5})});
}

TEST_P(Upscale, RejectsBadShape) {
  const Tensor raw = ctx().tensor({2, 6}), points = ctx().tensor({2, 3}), feature = ctx().tensor({2, 5}),
               children = ctx().tensor({4, 3}), wide = ctx().tensor({4, 11});
  EXPECT_THROW(upscale_forward(ctx(), {raw, points, feature, 2, 1, 1, children, children, wide}), Error);
  EXPECT_THROW(upscale_forward(ctx(), {raw, points, feature, 1, 1, 1, points, children, wide}), Error);
  EXPECT_THROW(upscale_forward(ctx(), {ctx().tensor({2, 5}), points, feature, 1, 1, 1, children, children, wide}),
               Error);
  EXPECT_THROW(upscale_backward(ctx(), {raw, 1, 1, 1, children, wide, raw, children, feature}), Error);
}

}  // namespace
}  // namespace vsplat
