#include "model/ops/dense/position_resample.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/position_resample.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class PositionResample : public test::FlavourTest {};
VSPLAT_FLAVOURS(PositionResample);
VSPLAT_OPERATION(PositionResample, position_resample)

TEST_P(PositionResample, EqualGridsAreLeftAlone) {
  const auto stored = test::random_floats(50 * 67, 3);
  const std::vector<float> none(67, 0.0f);
  const Tensor grid = ctx().upload({50, 67}, stored), out = ctx().upload({50, 67}, test::nans(50 * 67));
  position_resample_forward(ctx(), {grid, ctx().upload({67}, none), 7, 7, out});
  EXPECT_EQ(ctx().read<float>(out), stored);
  const Tensor dstored = ctx().upload({50, 67}, std::vector<float>(50 * 67, 0.0f)), dclass = ctx().upload({67}, none);
  position_resample_backward(ctx(), {grid, 7, 7, dstored, dclass});
  EXPECT_EQ(ctx().read<float>(dstored), stored);
  EXPECT_EQ(ctx().read<float>(dclass), std::vector<float>(stored.begin(), stored.begin() + 67));
}

TEST_P(PositionResample, RejectsBadShape) {
  const Tensor nine = ctx().tensor({9, 4}), five = ctx().tensor({5, 4}), dclass = ctx().tensor({4});
  EXPECT_THROW(position_resample_forward(ctx(), {nine, dclass, 3, 2, five}), Error);
  EXPECT_THROW(position_resample_backward(ctx(), {five, 3, 2, nine, dclass}), Error);
  EXPECT_THROW(position_resample_backward(ctx(), {ctx().tensor({4, 4}), 3, 2, ctx().tensor({10, 4}), dclass}), Error);
  EXPECT_THROW(position_resample_backward(ctx(), {five, 0, 2, ctx().tensor({1, 4}), dclass}), Error);
}

// The reference for the backward kernel is itself checked against differences of the forward reference.
TEST(PositionResampleReference, GradientsAreThoseOfDifferences) {
  for (const auto& [g, t] : {std::pair<std::size_t, std::size_t>{1, 3}, {3, 2}, {2, 5}, {5, 2}}) {
    const std::size_t c = 2;
    auto grid = test::random_doubles(g * g * c, 1);
    const auto dout = test::random_doubles(t * t * c, 2);
    const auto loss = [&, g = g, t = t] { return ref::weighed(ref::resample(grid, g, t, c), dout); };
    const std::vector<double> slopes = ref::linear_differences(grid, loss);
    EXPECT_TRUE(test::close(ref::resample_backward(dout, g, t, c), slopes, 1e-12)) << g << " to " << t;
  }
}

}  // namespace
}  // namespace vsplat
