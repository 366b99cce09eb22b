#include "model/ops/dense/position_resample.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/position_resample.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class PositionResample : public test::FlavourTest {
 protected:
  std::vector<float> run(const std::vector<float>& stored, const std::vector<float>& class_token, long g, long t) {
    const long c = static_cast<long>(class_token.size());
    PositionResampleForward a;
    a.stored = ctx().upload({1 + g * g, c}, stored);
    a.class_token = ctx().upload({c}, class_token);
    a.from = static_cast<int>(g);
    a.to = static_cast<int>(t);
    a.out = ctx().upload({1 + t * t, c}, test::nans(static_cast<std::size_t>((1 + t * t) * c)));
    position_resample_forward(ctx(), a);
    return ctx().read<float>(a.out);
  }
};
VSPLAT_FLAVOURS(PositionResample);
VSPLAT_OPERATION(PositionResample, position_resample)

TEST_P(PositionResample, EqualGridsAreLeftAlone) {
  const auto stored = test::random_floats(50 * 67, 3);
  const std::vector<float> class_token(67, 0.0f);
  EXPECT_EQ(run(stored, class_token, 7, 7), stored);
}

TEST_P(PositionResample, RejectsBadShape) {
  PositionResampleForward a;
  a.stored = ctx().tensor({9, 4});
  a.class_token = ctx().tensor({4});
  a.from = 3;
  a.to = 2;
  a.out = ctx().tensor({5, 4});
  EXPECT_THROW(position_resample_forward(ctx(), a), Error);
}

// The reference for the backward kernel is itself checked against differences of the forward reference.
TEST(PositionResampleReference, GradientsAreThoseOfDifferences) {
  for (const auto& [g, t] : {std::pair<std::size_t, std::size_t>{1, 3}, {3, 2}, {2, 5}, {5, 2}}) {
    const std::size_t c = 2;
    const auto doubles = [](const std::vector<float>& v) { return std::vector<double>(v.begin(), v.end()); };
    auto grid = doubles(test::random_floats(g * g * c, 1));
    const auto dout = doubles(test::random_floats(t * t * c, 2));
    const auto loss = [&, g = g, t = t] { return ref::weighed(ref::resample(grid, g, t, c), dout); };
    const std::vector<double> slopes = ref::linear_differences(grid, loss);
    EXPECT_TRUE(test::close(ref::resample_backward(dout, g, t, c), slopes, 1e-12)) << g << " to " << t;
  }
}

class PositionResampleGradient : public test::FlavourTest {
 protected:
  // Adds to `stored` and `class_token`.
  void run(const std::vector<float>& dout, std::vector<float>& stored, std::vector<float>& class_token, long g,
           long t) {
    const long c = static_cast<long>(class_token.size());
    const PositionResampleBackward a{ctx().upload({1 + t * t, c}, dout), static_cast<int>(g), static_cast<int>(t),
                                     ctx().upload({1 + g * g, c}, stored), ctx().upload({c}, class_token)};
    position_resample_backward(ctx(), a);
    stored = ctx().read<float>(a.dstored);
    class_token = ctx().read<float>(a.dclass_token);
  }
};
VSPLAT_FLAVOURS(PositionResampleGradient);

TEST_P(PositionResampleGradient, OfEqualGridsIsLeftAlone) {
  const auto dout = test::random_floats(50 * 67, 3);
  std::vector<float> stored(50 * 67, 0.0f), class_token(67, 0.0f);
  run(dout, stored, class_token, 7, 7);
  EXPECT_EQ(stored, dout);
  EXPECT_EQ(class_token, std::vector<float>(dout.begin(), dout.begin() + 67));
}

TEST_P(PositionResampleGradient, RejectsBadShape) {
  const Tensor dclass = ctx().tensor({4});
  EXPECT_THROW(position_resample_backward(ctx(), {ctx().tensor({5, 4}), 3, 2, ctx().tensor({9, 4}), dclass}), Error);
  EXPECT_THROW(position_resample_backward(ctx(), {ctx().tensor({4, 4}), 3, 2, ctx().tensor({10, 4}), dclass}), Error);
  EXPECT_THROW(position_resample_backward(ctx(), {ctx().tensor({5, 4}), 0, 2, ctx().tensor({1, 4}), dclass}), Error);
}

}  // namespace
}  // namespace vsplat
