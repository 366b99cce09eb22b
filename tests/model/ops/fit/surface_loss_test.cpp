#include "model/ops/fit/surface_loss.h"

#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/surface_loss.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SurfaceLossOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(SurfaceLossOp);
VSPLAT_OPERATION(SurfaceLossOp, surface_loss)

// Value and gradients, these by differences of the reference: it is linear in each map. Sizes about a group's block.
TEST_P(SurfaceLossOp, MatchesReference) {
  for (const auto& [height, width] :
       {std::pair{1L, 1L}, {1L, 3L}, {7L, 1L}, {31L, 11L}, {1L, 2047L}, {32L, 64L}, {1L, 2049L}, {97L, 61L}}) {
    SCOPED_TRACE(std::to_string(height) + " x " + std::to_string(width));
    const auto n = static_cast<std::size_t>(height * width);
    const auto normal = test::random_floats(3 * n, 1), depth_normal = test::random_floats(3 * n, 2),
               alpha = test::random_floats(n, 3, 0, 1), distortion = test::random_floats(n, 4, 0, 0.1f);
    const Shape maps{height, width, 3}, map{height, width};
    SurfaceLoss a;
    a.normal = ctx().upload(maps, normal), a.depth_normal = ctx().upload(maps, depth_normal);
    a.alpha = ctx().upload(map, alpha), a.distortion = ctx().upload(map, distortion);
    a.weights = {7, 0.3f};
    a.value = ctx().upload({3}, std::vector<float>{2, 3, 4});
    a.dnormal = ctx().upload(maps, test::nans(3 * n)), a.ddepth_normal = ctx().upload(maps, test::nans(3 * n));
    a.ddistortion = ctx().upload(map, test::nans(n));
    a.gradient_scale = 0.25f;
    surface_loss(ctx(), a);

    const auto value = [&](const std::vector<double>& by_normal, const std::vector<double>& by_depth_normal,
                           const std::vector<double>& by_distortion) {
      return ref::surface_loss(by_normal, by_depth_normal, test::as_doubles(alpha), by_distortion, 7, 0.3f);
    };
    const double want = value(test::as_doubles(normal), test::as_doubles(depth_normal), test::as_doubles(distortion));
    EXPECT_TRUE(test::close(ctx().read<float>(a.value), std::vector<double>{2 + want, 3, 4}, 1e-6));

    // What one number of a map is worth, for some of them; the others are as good.
    const auto expect_slopes = [&](const Tensor& got, std::vector<double> at, const auto& of, const char* what) {
      const std::vector<float> slopes = ctx().read<float>(got);
      for (std::size_t i = 0; i < at.size(); i += 1 + at.size() / 17) {
        const double was = at[i];
        at[i] = was + 1;
        const double up = of(at);
        at[i] = was - 1;
        EXPECT_NEAR(slopes[i], 0.25 * (up - of(at)) / 2, 1e-5 / static_cast<double>(n)) << what << " " << i;
        at[i] = was;
      }
      for (const float slope : slopes) ASSERT_TRUE(std::isfinite(slope)) << what;
    };
    expect_slopes(
        a.dnormal, test::as_doubles(normal),
        [&](const auto& x) { return value(x, test::as_doubles(depth_normal), test::as_doubles(distortion)); },
        "normal");
    expect_slopes(
        a.ddepth_normal, test::as_doubles(depth_normal),
        [&](const auto& x) { return value(test::as_doubles(normal), x, test::as_doubles(distortion)); },
        "depth_normal");
    expect_slopes(
        a.ddistortion, test::as_doubles(distortion),
        [&](const auto& x) { return value(test::as_doubles(normal), test::as_doubles(depth_normal), x); },
        "distortion");
  }
}

// A picture without pixels has no loss.
TEST_P(SurfaceLossOp, NoPixels) {
  SurfaceLoss a;
  a.normal = a.depth_normal = a.dnormal = a.ddepth_normal = ctx().tensor({0, 5, 3});
  a.alpha = a.distortion = a.ddistortion = ctx().tensor({0, 5});
  a.weights = {1, 1};
  a.value = ctx().upload({1}, std::vector<float>{2});
  surface_loss(ctx(), a);
  EXPECT_EQ(ctx().read<float>(a.value), std::vector<float>{2});
}

}  // namespace
}  // namespace vsplat
