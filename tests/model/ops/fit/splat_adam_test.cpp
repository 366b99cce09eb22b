#include "model/ops/fit/splat_adam.h"

#include <array>

#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SplatAdamOp : public test::FlavourTest {
 protected:
  SplatAdam with(double rate) {
    SplatAdam a;
    a.rate = rate;
    return a;
  }
};
VSPLAT_FLAVOURS(SplatAdamOp);
VSPLAT_OPERATION(SplatAdamOp, splat_adam)

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
