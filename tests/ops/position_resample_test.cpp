#include "model/ops/position_resample.h"

#include "tests/reference/position_resample.h"
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

}  // namespace
}  // namespace vsplat
