#include "model/ops/dense/groupnorm.h"

#include <fmt/format.h>

#include <functional>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/groupnorm.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

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
VSPLAT_OPERATION(GroupNorm, groupnorm)

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
  const auto doubles = [](std::size_t count, std::uint32_t seed) {
    const std::vector<float> v = test::random_floats(count, seed, -2.0f, 2.0f);
    return std::vector<double>(v.begin(), v.end());
  };
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

class GroupNormGradient : public test::FlavourTest {
 protected:
  struct Problem {
    long n, c0, c1;
    int groups;
    std::vector<float> x, gamma, beta, dy;
    long c() const { return c0 + c1; }
    // One source's columns.
    std::vector<float> part(const std::vector<float>& of, bool second) const {
      std::vector<float> out;
      for (std::size_t i = 0; i < of.size(); ++i)
        if ((static_cast<long>(i) % c() >= c0) == second) out.push_back(of[i]);
      return out;
    }
    ref::GroupNormGradient want() const {
      return ref::groupnorm_backward(x, static_cast<std::size_t>(n), static_cast<std::size_t>(c()),
                                     static_cast<std::size_t>(groups), gamma, beta, 1e-6, dy);
    }
  };

  static Problem make(long n, long c0, long c1, int groups) {
    const auto count = static_cast<std::size_t>(n * (c0 + c1)), c = static_cast<std::size_t>(c0 + c1);
    Problem p{n,
              c0,
              c1,
              groups,
              test::random_floats(count, 31, -1.0f, 2.0f),
              test::random_floats(c, 32, -1.5f, 1.5f),
              test::random_floats(c, 33),
              test::random_floats(count, 34)};
    p.gamma[0] = 0.0f;  // scale says nothing about the variance there
    return p;
  }

  // Runs the forward; every output as NaN, dgamma and dbeta as zeros.
  GroupNormBackward upload(const Problem& p) {
    const auto c = static_cast<std::size_t>(p.c());
    GroupNormForward f;
    f.x0 = ctx().upload({p.n, p.c0}, p.part(p.x, false));
    if (p.c1 > 0) f.x1 = ctx().upload({p.n, p.c1}, p.part(p.x, true));
    f.gamma = ctx().upload({p.c()}, p.gamma);
    f.beta = ctx().upload({p.c()}, p.beta);
    f.groups = p.groups;
    for (Tensor* t : {&f.scale, &f.shift, &f.mean, &f.rstd}) *t = ctx().upload({p.c()}, test::nans(c));
    groupnorm_forward(ctx(), f);
    GroupNormBackward b;
    b.x0 = f.x0, b.x1 = f.x1, b.gamma = f.gamma, b.groups = p.groups;
    b.scale = f.scale, b.shift = f.shift, b.mean = f.mean, b.rstd = f.rstd;
    b.dy = ctx().upload({p.n, p.c()}, p.dy);
    b.dx0 = ctx().upload({p.n, p.c0}, test::nans(static_cast<std::size_t>(p.n * p.c0)));
    if (p.c1 > 0) b.dx1 = ctx().upload({p.n, p.c1}, test::nans(static_cast<std::size_t>(p.n * p.c1)));
    b.dgamma = ctx().upload({p.c()}, std::vector<float>(c, 0.0f));
    b.dbeta = ctx().upload({p.c()}, std::vector<float>(c, 0.0f));
    return b;
  }

  // Both sources' columns side by side.
  std::vector<float> gradient(const Problem& p, const GroupNormBackward& b) {
    const std::vector<float> d0 = ctx().read<float>(b.dx0), d1 = b.dx1 ? ctx().read<float>(b.dx1) : d0;
    std::vector<float> out;
    for (long i = 0; i < p.n; ++i) {
      out.insert(out.end(), d0.begin() + i * p.c0, d0.begin() + (i + 1) * p.c0);
      if (p.c1 > 0) out.insert(out.end(), d1.begin() + i * p.c1, d1.begin() + (i + 1) * p.c1);
    }
    return out;
  }

  void check(const Problem& p) {
    SCOPED_TRACE(fmt::format("{} x ({} + {}), {} groups", p.n, p.c0, p.c1, p.groups));
    const GroupNormBackward b = upload(p);
    groupnorm_backward(ctx(), b);
    const ref::GroupNormGradient want = p.want();
    EXPECT_TRUE(test::close(gradient(p, b), want.dx, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(b.dgamma), want.dgamma, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(b.dbeta), want.dbeta, 1e-5));
  }
};
VSPLAT_FLAVOURS(GroupNormGradient);

// With one or two numbers, the output depends on them only through eps.
TEST_P(GroupNormGradient, FewerNumbersThanDegreesOfFreedomHaveNoGradient) {
  for (const auto& [n, c] : {std::pair{1L, 2L}, {2L, 2L}}) {
    const Problem p = make(n, c, 0, static_cast<int>(n));
    const GroupNormBackward b = upload(p);
    groupnorm_backward(ctx(), b);
    const std::vector<float> rstd = ctx().read<float>(b.rstd), got = ctx().read<float>(b.dx0);
    const std::vector<double> want = p.want().dx;
    for (std::size_t i = 0; i < got.size(); ++i)
      EXPECT_NEAR(got[i], want[i], 1e-6 * rstd[i % static_cast<std::size_t>(c)]) << n << " " << i;
  }
}

TEST_P(GroupNormGradient, AddsWhereAsked) {
  const Problem p = make(37, 20, 4, 4);
  GroupNormBackward b = upload(p);
  const auto plus = [](std::vector<double> v, double by) {
    for (double& e : v) e += by;
    return v;
  };
  b.add = true;
  ctx().write(b.dx0, std::vector<float>(37 * 20, 2.0f).data());
  ctx().write(b.dx1, std::vector<float>(37 * 4, 2.0f).data());
  ctx().write(b.dgamma, std::vector<float>(24, 3.0f).data());
  ctx().write(b.dbeta, std::vector<float>(24, 4.0f).data());
  groupnorm_backward(ctx(), b);
  const ref::GroupNormGradient want = p.want();
  EXPECT_TRUE(test::close(gradient(p, b), plus(want.dx, 2), 1e-5));
  EXPECT_TRUE(test::close(ctx().read<float>(b.dgamma), plus(want.dgamma, 3), 1e-5));
  EXPECT_TRUE(test::close(ctx().read<float>(b.dbeta), plus(want.dbeta, 4), 1e-5));
}

TEST_P(GroupNormGradient, InPlaceAndTheSameBitsEachTime) {
  const Problem p = make(999, 33, 0, 3);
  GroupNormBackward first = upload(p);
  groupnorm_backward(ctx(), first);
  GroupNormBackward second = upload(p);
  second.dx0 = second.dy;
  groupnorm_backward(ctx(), second);
  EXPECT_EQ(ctx().read<float>(second.dx0), ctx().read<float>(first.dx0));
  EXPECT_EQ(ctx().read<float>(second.dgamma), ctx().read<float>(first.dgamma));
  EXPECT_EQ(ctx().read<float>(second.dbeta), ctx().read<float>(first.dbeta));
}

// Where SiLU's exponential is beyond what floats hold.
TEST_P(GroupNormGradient, LargeValuesStayFinite) {
  Problem p = make(50, 18, 0, 2);
  for (std::size_t i = 0; i < 18; ++i) p.gamma[i] = 100.0f, p.beta[i] = i % 2 ? -300.0f : 300.0f;
  check(p);
}

TEST_P(GroupNormGradient, NoRowsAddNothing) {
  const Problem p = make(0, 4, 0, 2);
  const GroupNormBackward b = upload(p);
  groupnorm_backward(ctx(), b);
  EXPECT_EQ(ctx().read<float>(b.dgamma), std::vector<float>(4, 0.0f));
  EXPECT_EQ(ctx().read<float>(b.dbeta), std::vector<float>(4, 0.0f));
}

TEST_P(GroupNormGradient, RejectsBadShape) {
  const GroupNormBackward good = upload(make(3, 4, 2, 2));
  const auto rejects = [&](const std::function<void(GroupNormBackward&)>& change) {
    GroupNormBackward bad = good;
    change(bad);
    EXPECT_THROW(groupnorm_backward(ctx(), bad), Error);
  };
  rejects([](GroupNormBackward& b) { b.groups = 4; });
  rejects([](GroupNormBackward& b) { b.dx1 = Tensor(); });
  rejects([](GroupNormBackward& b) { b.dy = b.x0; });
  rejects([](GroupNormBackward& b) { b.rstd = Tensor(); });
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
