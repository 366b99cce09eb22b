#include "model/ops/fit/splat_adam.h"

#include <array>

#include "model/diagnose/selftest/reference/splat_adam.h"
#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SplatAdamOp : public test::FlavourTest {
 protected:
  // Five steps, at a rate so high that the rounding of the parameters hides nothing of them. `shape` is of one
  // Gaussian's parameters.
  void check(long count, Shape shape, SplatAdam a) {
    shape.insert(shape.begin(), count);
    long n = 1;
    for (const long d : shape) n *= d;
    const auto size = static_cast<std::size_t>(n), width = count > 0 ? size / static_cast<std::size_t>(count) : 1;
    SCOPED_TRACE(::testing::Message() << count << " of " << width << ", head " << a.head);
    const auto seed = static_cast<std::uint32_t>(n);
    const auto start = test::random_floats(size, seed);
    const std::vector<float> zeros(size, 0.0f);
    a.param = ctx().upload(shape, start), a.m = ctx().upload(shape, zeros), a.v = ctx().upload(shape, zeros);
    const ref::SplatAdam want{a.rate,
                              a.rate_rest,
                              a.beta1,
                              a.beta2,
                              a.eps,
                              static_cast<double>(a.low),
                              static_cast<double>(a.high),
                              width,
                              a.head > 0 ? static_cast<std::size_t>(a.head) : width};
    auto param = test::as_doubles(start);
    std::vector<double> m(size), v(size);
    for (a.step = 1; a.step <= 5; ++a.step) {
      // Over many magnitudes, down to where a larger eps counts.
      auto grad = test::random_floats(size, seed + static_cast<std::uint32_t>(a.step), -1e-6f, 1e-6f);
      for (std::size_t i = 0; i < size; i += 2) grad[i] *= 1e6f;
      a.grad = ctx().upload(shape, grad);
      splat_adam(ctx(), a);
      ref::splat_adam(want, a.step, test::as_doubles(grad), param, m, v);
      EXPECT_TRUE(test::close(ctx().read<float>(a.param), param, 2e-6)) << "step " << a.step;
      EXPECT_TRUE(test::close(ctx().read<float>(a.m), m, 1e-6)) << "step " << a.step;
      EXPECT_TRUE(test::close(ctx().read<float>(a.v), v, 1e-6)) << "step " << a.step;
      EXPECT_EQ(ctx().read<float>(a.grad), zeros) << "step " << a.step;
    }
  }

  SplatAdam with(double rate, long head = 0, double rest = 0) {
    SplatAdam a;
    a.rate = rate, a.head = head, a.rate_rest = rest;
    return a;
  }
};
VSPLAT_FLAVOURS(SplatAdamOp);
VSPLAT_OPERATION(SplatAdamOp, splat_adam)

TEST_P(SplatAdamOp, StepsMatchReferenceAtEverySizeThatBreaksThings) {
  for (const long count : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1009L}) {
    check(count, {}, with(0.1));
    check(count, {3}, with(0.1));
  }
  SplatAdam other = with(0.1);
  other.beta1 = 0.8, other.beta2 = 0.9, other.eps = 1e-7;
  check(65, {3}, other);
}

// Spherical harmonics: the constant coefficient's three numbers, and the others, at a rate of their own or none.
TEST_P(SplatAdamOp, TheHeadOfEachGaussianHasItsOwnRate) {
  for (const long count : {1L, 7L, 64L, 1009L})
    for (const long s : {1L, 4L, 16L}) {
      check(count, {s, 3}, with(0.1, 3, 0.02));
      check(count, {s, 3}, with(0.1, 3, 0));
      check(count, {s, 3}, with(0, 3, 0.1));
    }
  check(65, {5}, with(0.1, 2, 0.3));
}

TEST_P(SplatAdamOp, HoldsParametersWithinLimits) {
  SplatAdam a = with(0.1);
  a.low = -0.5f, a.high = 0.25f;
  check(1009, {3}, a);
  a.low = -std::numeric_limits<float>::infinity();
  check(65, {}, a);
}

// The first step is the rate, whatever the gradient's size; none where there is none.
TEST_P(SplatAdamOp, FirstStepIsTheRate) {
  SplatAdam a = with(0.125);
  a.param = ctx().upload({5}, std::vector<float>(5, 1.0f));
  a.grad = ctx().upload({5}, std::vector<float>{1e-8f, -3e4f, 0, 2, -1e-9f});
  a.m = ctx().upload({5}, std::vector<float>(5, 0.0f)), a.v = ctx().upload({5}, std::vector<float>(5, 0.0f));
  splat_adam(ctx(), a);
  EXPECT_TRUE(test::close(ctx().read<float>(a.param), std::vector<double>{0.875, 1.125, 1, 0.875, 1.125}, 2e-6));
}

TEST_P(SplatAdamOp, RejectsWhatDoesNotFit) {
  const Tensor two = ctx().tensor({2}), three = ctx().tensor({3}), whole = ctx().tensor({2}, Type::i32);
  EXPECT_THROW(splat_adam(ctx(), {two, three, two, two}), Error);
  EXPECT_THROW(splat_adam(ctx(), {two, two, three, two}), Error);
  EXPECT_THROW(splat_adam(ctx(), {two, two, two, three}), Error);
  EXPECT_THROW(splat_adam(ctx(), {two, two, two, Tensor()}), Error);
  EXPECT_THROW(splat_adam(ctx(), {whole, whole, whole, whole}), Error);
  EXPECT_THROW(splat_adam(ctx(), {two, two, two, two, 0}), Error);
}

// What a picture does not touch stays, moments and all; the others move as they would without it.
TEST_P(SplatAdamOp, SparseLeavesWhatHasNoGradient) {
  for (const std::size_t n : {3U, 16U, 17U, 1009U, 2051U}) {
    const auto count = static_cast<long>(n);
    const auto start = test::random_floats(n, 1), moments = test::random_floats(n, 2, 0, 1);
    auto grad = test::random_floats(n, 3);
    for (std::size_t i = 0; i < n; ++i)
      if (i % 3 == 0 || i / 64 % 2 == 1) grad[i] = 0;  // single ones, and runs of them
    const auto step = [&](bool sparse) {
      SplatAdam a = with(0.1);
      a.step = 4, a.sparse = sparse;
      a.param = ctx().upload({count}, start), a.grad = ctx().upload({count}, grad);
      a.m = ctx().upload({count}, moments), a.v = ctx().upload({count}, moments);
      splat_adam(ctx(), a);
      EXPECT_EQ(ctx().read<float>(a.grad), std::vector<float>(n, 0.0f));
      return std::array{ctx().read<float>(a.param), ctx().read<float>(a.m), ctx().read<float>(a.v)};
    };
    const auto sparse = step(true), dense = step(false);
    for (std::size_t i = 0; i < n; ++i) {
      const bool touched = grad[i] != 0;
      EXPECT_EQ(sparse[0][i], touched ? dense[0][i] : start[i]) << i << " of " << n;
      EXPECT_EQ(sparse[1][i], touched ? dense[1][i] : moments[i]) << i << " of " << n;
      EXPECT_EQ(sparse[2][i], touched ? dense[2][i] : moments[i]) << i << " of " << n;
      EXPECT_NE(dense[0][i], start[i]) << i;
    }
  }
}

}  // namespace
}  // namespace vsplat
