#include "model/ops/dense/groupnorm.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/groupnorm.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class GroupNorm : public test::FlavourTest {};
VSPLAT_FLAVOURS(GroupNorm);
VSPLAT_OPERATION(GroupNorm, groupnorm)

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

// The reference's gradients against differences of the reference.
TEST(GroupNormReference, GradientsAreDifferences) {
  const std::size_t n = 5, c = 6, groups = 3;
  const auto doubles = [](std::size_t count, std::uint32_t seed) { return test::random_doubles(count, seed, -2, 2); };
  std::vector<double> x = doubles(n * c, 1), gamma = doubles(c, 2), beta = doubles(c, 3);
  const std::vector<double> dy = doubles(n * c, 4);
  const auto loss = [&] {
    const std::vector<double> z = ref::groupnorm(x, n, c, groups, gamma, beta, 1e-6);
    double sum = 0;
    for (std::size_t i = 0; i < z.size(); ++i) sum += dy[i] * z[i] / (1 + std::exp(-z[i]));
    return sum;
  };
  const auto differences = [&](std::vector<double>& by) {
    std::vector<double> out;
    out.reserve(by.size());
    for (double& v : by) out.push_back(ref::derivative_by(v, 1e-3, loss));
    return out;
  };
  const ref::GroupNormGradient g = ref::groupnorm_backward(x, n, c, groups, gamma, beta, 1e-6, dy);
  EXPECT_TRUE(test::close(g.dx, differences(x), 1e-8));
  EXPECT_TRUE(test::close(g.dgamma, differences(gamma), 1e-8));
  EXPECT_TRUE(test::close(g.dbeta, differences(beta), 1e-8));
}

// With one or two numbers, the output depends on them only through eps.
TEST_P(GroupNorm, FewerNumbersThanDegreesOfFreedomHaveNoGradient) {
  const auto gamma = std::vector<float>{0, test::random_floats(2, 32, -1.5f, 1.5f)[1]},
             beta = test::random_floats(2, 33);
  for (const long n : {1L, 2L}) {
    const auto count = static_cast<std::size_t>(2 * n);
    const auto x = test::random_floats(count, 31, -1, 2), dy = test::random_floats(count, 34);
    GroupNormForward f;
    f.x0 = ctx().upload({n, 2}, x), f.gamma = ctx().upload({2}, gamma), f.beta = ctx().upload({2}, beta);
    f.groups = static_cast<int>(n);
    for (Tensor* t : {&f.scale, &f.shift, &f.mean, &f.rstd}) *t = ctx().upload({2}, test::nans(2));
    groupnorm_forward(ctx(), f);
    GroupNormBackward b;
    b.x0 = f.x0, b.gamma = f.gamma, b.groups = f.groups, b.dy = ctx().upload({n, 2}, dy);
    b.scale = f.scale, b.shift = f.shift, b.mean = f.mean, b.rstd = f.rstd;
    b.dx0 = ctx().upload({n, 2}, test::nans(count));
    b.dgamma = ctx().upload({2}, beta), b.dbeta = ctx().upload({2}, beta);
    groupnorm_backward(ctx(), b);
    const std::vector<float> rstd = ctx().read<float>(b.rstd), got = ctx().read<float>(b.dx0);
    const auto want = ref::groupnorm_backward(x, count / 2, 2, count / 2, gamma, beta, 1e-6, dy).dx;
    for (std::size_t i = 0; i < count; ++i) EXPECT_NEAR(got[i], want[i], 1e-6 * rstd[i % 2]) << n << " " << i;
  }
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
  const Tensor two = ctx().tensor({3, 2}), six = ctx().tensor({6}), dy = ctx().tensor({3, 6});
  const GroupNormBackward good{f.x0, two, six, six, six, six, six, 2, dy, f.x0, two, false, six, six};
  const auto rejects = [&](const auto& change) {
    GroupNormBackward bad = good;
    change(bad);
    EXPECT_THROW(groupnorm_backward(ctx(), bad), Error);
  };
  rejects([](GroupNormBackward& b) { b.groups = 4; });
  rejects([](GroupNormBackward& b) { b.dx1 = Tensor(); });
  rejects([](GroupNormBackward& b) { b.dy = b.x0; });
  rejects([](GroupNormBackward& b) { b.rstd = Tensor(); });
}

}  // namespace
}  // namespace vsplat
