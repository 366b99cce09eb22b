#include "model/ops/fit/lpips.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class LpipsOps : public test::FlavourTest {};
VSPLAT_FLAVOURS(LpipsOps);
VSPLAT_OPERATION(LpipsOps, lpips)

TEST_P(LpipsOps, ReluClampsAndKeepsWhatIsNoNumber) {
  const Tensor t = ctx().upload({2}, std::vector<float>{std::nanf(""), -1});
  relu(ctx(), t);
  EXPECT_TRUE(std::isnan(ctx().read<float>(t)[0]));
  relu(ctx(), ctx().tensor({0}));
}

// Features that are all zero have no direction, and are no error.
TEST_P(LpipsOps, DistanceOfFeaturesThatAreZero) {
  const std::vector<float> zeros(8, 0.0f), some = {3, 0, 0, 4, 0, 1, 0, 0}, ones(4, 1.0f);
  const Tensor out = ctx().upload({2}, test::nans(2));
  feature_distance(ctx(), {ctx().upload({2, 4}, zeros), ctx().upload({2, 4}, some), ctx().upload({4}, ones), out});
  EXPECT_TRUE(test::close(ctx().read<float>(out), std::vector<double>{1, 1}, 1e-6));
}

TEST_P(LpipsOps, RejectsBadShapes) {
  EXPECT_THROW(picture_map(ctx(), 3, 9, {5, 1, 0}), Error);
  EXPECT_THROW(max_pool(ctx(), ctx().tensor({2, 5, 3}), {3, 2, 0}), Error);
  EXPECT_THROW(max_pool(ctx(), ctx().tensor({5, 5}), {3, 2, 0}), Error);
  const Tensor a = ctx().tensor({2, 4}), b = ctx().tensor({2, 3}), w = ctx().tensor({4}), out = ctx().tensor({2});
  EXPECT_THROW(feature_distance(ctx(), {a, b, w, out}), Error);
  EXPECT_THROW(feature_distance(ctx(), {a, a, out, out}), Error);
  EXPECT_THROW(feature_distance(ctx(), {a, a, w, w}), Error);
}

}  // namespace
}  // namespace vsplat
