#include "model/ops/networks/ray_loss.h"

#include "model/diagnose/selftest/reference/ray_loss.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RayLossTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(RayLossTest);
VSPLAT_OPERATION(RayLossTest, ray_loss)

TEST_P(RayLossTest, MatchesReferenceAndItsDifferences) {
  for (const long r : {1L, 3L, 7L, 63L, 64L, 65L, 4099L}) {
    const auto count = static_cast<std::size_t>(r) * 6;
    const auto x = test::random_floats(count, 1), y = test::random_floats(count, 2);
    const Tensor predicted = ctx().upload({r, 6}, x), target = ctx().upload({r, 6}, y);
    const Tensor out = ctx().upload({1}, test::nans(1)), dx = ctx().upload({r, 6}, test::nans(count));
    ray_loss(ctx(), {predicted, target, out, dx, 0.25f});
    std::vector<double> at(x.begin(), x.end()), slopes;
    EXPECT_NEAR(ctx().read<float>(out)[0], ref::ray_loss(at, y), 1e-6) << r;
    if (r > 100) continue;
    for (double& value : at) {
      const double before = value;
      value = before + 0.5;  // of a square any step does
      const double above = ref::ray_loss(at, y);
      value = before - 0.5;
      slopes.push_back(0.25 * (above - ref::ray_loss(at, y)));
      value = before;
    }
    EXPECT_TRUE(test::close(ctx().read<float>(dx), slopes, 1e-6)) << r;
    ctx().write(out, test::nans(1).data());
    ray_loss(ctx(), {predicted, target, out, {}});
    EXPECT_NEAR(ctx().read<float>(out)[0], ref::ray_loss(at, y), 1e-6) << r;
  }
}

TEST_P(RayLossTest, EmptyAndBadShape) {
  const Tensor one = ctx().tensor({1}), none = ctx().tensor({0, 6}), two = ctx().tensor({2, 6});
  EXPECT_THROW(ray_loss(ctx(), {none, none, one, {}}), Error);
  EXPECT_THROW(ray_loss(ctx(), {two, ctx().tensor({3, 6}), one, {}}), Error);
}

}  // namespace
}  // namespace vsplat
