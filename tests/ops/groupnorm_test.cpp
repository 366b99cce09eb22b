#include "model/ops/groupnorm.h"

#include "tests/reference/groupnorm.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class GroupNorm : public test::FlavourTest {
 protected:
  // What a consumer makes of x, scale and shift, and what GroupNorm makes of x. Relative to the largest of the outputs.
  void check(const std::vector<float>& x, long n, long c0, long c1, int groups, double tolerance) {
    const auto c = static_cast<std::size_t>(c0 + c1), rows = static_cast<std::size_t>(n);
    std::vector<float> a, b;
    for (std::size_t i = 0; i < x.size(); ++i) (i % c < static_cast<std::size_t>(c0) ? a : b).push_back(x[i]);
    const std::vector<float> gamma = test::random_floats(c, 5, 0.5f, 1.5f), beta = test::random_floats(c, 6);
    GroupNormForward f;
    f.x0 = ctx().upload({n, c0}, a);
    if (c1 > 0) f.x1 = ctx().upload({n, c1}, b);
    f.gamma = ctx().upload({c0 + c1}, gamma);
    f.beta = ctx().upload({c0 + c1}, beta);
    f.groups = groups;
    f.scale = ctx().upload({c0 + c1}, test::nans(c));
    f.shift = ctx().upload({c0 + c1}, test::nans(c));
    groupnorm_forward(ctx(), f);
    const std::vector<float> scale = ctx().read<float>(f.scale), shift = ctx().read<float>(f.shift);
    std::vector<float> y(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) y[i] = x[i] * scale[i % c] + shift[i % c];
    EXPECT_TRUE(
        test::close(y, ref::groupnorm(x, rows, c, static_cast<std::size_t>(groups), gamma, beta, 1e-6), tolerance))
        << n << " x (" << c0 << " + " << c1 << "), " << groups << " groups";
  }
};
VSPLAT_FLAVOURS(GroupNorm);

TEST_P(GroupNorm, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const long n : {1L, 3L, 7L, 8L, 9L, 31L, 33L, 101L, 517L}) {
    for (const auto& [c, g] : {std::pair{1L, 1}, {6L, 3}, {16L, 4}, {17L, 1}, {66L, 11}}) {
      check(test::random_floats(static_cast<std::size_t>(n * c), static_cast<std::uint32_t>(n * 100 + c)), n, c, 0, g,
            1e-5);
    }
  }
}

TEST_P(GroupNorm, ManyChunks) { check(test::random_floats(40000 * 5, 3, -1.0f, 3.0f), 40000, 5, 0, 5, 1e-5); }

TEST_P(GroupNorm, TwoSourcesWithAGroupAcrossBoth) {
  for (const long n : {1L, 50L, 700L}) {
    check(test::random_floats(static_cast<std::size_t>(n * 60), 9), n, 20, 40, 4,
          1e-5);  // the second group is channels 15 to 29
    check(test::random_floats(static_cast<std::size_t>(n * 24), 9), n, 23, 1, 3, 1e-5);
  }
}

// float32 itself keeps x to 300 * 6e-8 of the deviation; the sum of squares minus the squared sum would lose 300^2
// times as much.
TEST_P(GroupNorm, MeansFarFromZeroWithSmallVariance) {
  for (const long n : {5L, 300L, 5000L}) {
    std::vector<float> x = test::random_floats(static_cast<std::size_t>(n * 12), 11, -0.01f, 0.01f);
    for (float& v : x) v += 3.0f;
    check(x, n, 12, 0, 3, 1e-4);
  }
}

// The first row, from which a shift would be taken, is nothing like the others; channels of a group differ, too.
TEST_P(GroupNorm, FirstRowAndChannelsUnlikeTheRest) {
  const long n = 3000, c = 8;
  std::vector<float> x = test::random_floats(static_cast<std::size_t>(n * c), 12, -0.1f, 0.1f);
  for (std::size_t i = 0; i < x.size(); ++i)
    x[i] += i < static_cast<std::size_t>(c) ? 0.0f : 5.0f + 0.5f * static_cast<float>(i % c);
  check(x, n, c, 0, 2, 1e-4);
}

TEST_P(GroupNorm, IsDeterministic) {
  const std::vector<float> x = test::random_floats(999 * 32, 4);
  GroupNormForward f;
  f.x0 = ctx().upload({999, 32}, x);
  f.gamma = ctx().upload({32}, test::random_floats(32, 1));
  f.beta = ctx().upload({32}, test::random_floats(32, 2));
  f.groups = 4;
  std::vector<std::vector<float>> seen;
  for (int i = 0; i < 3; ++i) {
    f.scale = ctx().tensor({32});
    f.shift = ctx().tensor({32});
    groupnorm_forward(ctx(), f);
    seen.push_back(ctx().read<float>(f.scale));
    EXPECT_EQ(seen.back(), seen.front());
  }
}

TEST_P(GroupNorm, EmptyInput) {
  GroupNormForward f;
  f.x0 = ctx().tensor({0, 4});
  f.gamma = ctx().upload({4}, std::vector<float>{1, 2, 3, 4});
  f.beta = ctx().upload({4}, std::vector<float>{5, 6, 7, 8});
  f.groups = 2;
  f.scale = ctx().upload({4}, test::nans(4));
  f.shift = ctx().upload({4}, test::nans(4));
  groupnorm_forward(ctx(), f);
  EXPECT_EQ(ctx().read<float>(f.shift), (std::vector<float>{5, 6, 7, 8}));
  EXPECT_TRUE(test::close(ctx().read<float>(f.scale), std::vector<double>{1e3, 2e3, 3e3, 4e3}, 1e-6));
}

TEST_P(GroupNorm, RejectsBadShape) {
  GroupNormForward f;
  f.x0 = ctx().tensor({3, 4});
  f.gamma = f.beta = f.scale = f.shift = ctx().tensor({4});
  f.groups = 3;
  EXPECT_THROW(groupnorm_forward(ctx(), f), Error);
  f.groups = 2;
  f.beta = ctx().tensor({5});
  EXPECT_THROW(groupnorm_forward(ctx(), f), Error);
}

}  // namespace
}  // namespace vsplat
