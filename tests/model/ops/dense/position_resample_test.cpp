#include "model/ops/dense/position_resample.h"

#include "model/diagnose/selftest/reference/position_resample.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

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

TEST_P(PositionResample, MatchesReferenceGrowingAndShrinking) {
  for (const auto& [g, t] : {std::pair{1L, 3L}, {3L, 2L}, {4L, 6L}, {14L, 32L}, {14L, 5L}, {7L, 1L}, {16L, 17L}}) {
    const std::size_t c = 5;
    const auto stored = test::random_floats(static_cast<std::size_t>(1 + g * g) * c, 1);
    const auto class_token = test::random_floats(c, 2);
    std::vector<double> want;
    for (std::size_t i = 0; i < c; ++i) want.push_back(static_cast<double>(stored[i]) + class_token[i]);
    const std::vector<float> grid(stored.begin() + c, stored.end());
    const auto rest = ref::resample(grid, static_cast<std::size_t>(g), static_cast<std::size_t>(t), c);
    want.insert(want.end(), rest.begin(), rest.end());
    EXPECT_TRUE(test::close(run(stored, class_token, g, t), want, 2e-6)) << g << " to " << t;
  }
}

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
    std::vector<double> slopes;
    for (double& at : grid) {
      const auto loss = [&, g = g, t = t](double value) {
        at = value;
        const auto out = ref::resample(grid, g, t, c);
        double sum = 0;
        for (std::size_t i = 0; i < out.size(); ++i) sum += dout[i] * out[i];
        return sum;
      };
      const double before = at;
      slopes.push_back(loss(before + 0.5) - loss(before - 0.5));  // linear: any step does
      at = before;
    }
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

TEST_P(PositionResampleGradient, MatchesReferenceGrowingAndShrinking) {
  for (const auto& [g, t] : {std::pair{1L, 3L}, {3L, 2L}, {4L, 6L}, {14L, 32L}, {14L, 5L}, {7L, 1L}, {16L, 17L}}) {
    const std::size_t c = 5, from = static_cast<std::size_t>(g), to = static_cast<std::size_t>(t);
    const auto dout = test::random_floats((1 + to * to) * c, 1);
    auto stored = test::random_floats((1 + from * from) * c, 2), class_token = test::random_floats(c, 3);
    std::vector<double> want, want_class;
    for (std::size_t i = 0; i < c; ++i) {
      want.push_back(static_cast<double>(dout[i]) + stored[i]);
      want_class.push_back(static_cast<double>(dout[i]) + class_token[i]);
    }
    const auto rest = ref::resample_backward(std::vector<double>(dout.begin() + c, dout.end()), from, to, c);
    for (std::size_t i = 0; i < rest.size(); ++i) want.push_back(rest[i] + stored[c + i]);
    run(dout, stored, class_token, g, t);
    EXPECT_TRUE(test::close(stored, want, 2e-6)) << g << " to " << t;
    EXPECT_TRUE(test::close(class_token, want_class, 2e-7)) << g << " to " << t;
  }
}

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
