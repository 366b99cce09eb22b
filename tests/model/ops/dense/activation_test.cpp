#include "model/ops/dense/activation.h"

#include "model/diagnose/selftest/reference/activation.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

constexpr Activation kAll[] = {Activation::gelu, Activation::silu, Activation::relu, Activation::gelu_tanh};

TEST(ActivationReference, SlopesAreThoseOfDifferences) {
  for (const int act : {1, 2, 3, 4})
    for (int i = -144; i < 144; ++i) {
      const double x = i / 16.0;
      if (act == 3 && i == 0) continue;  // where there is none
      EXPECT_NEAR(ref::activation_slope(x, act), (ref::activate(x + 1e-5, act) - ref::activate(x - 1e-5, act)) / 2e-5,
                  1e-9)
          << x;
    }
}

class ActivationTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(ActivationTest);
VSPLAT_OPERATION(ActivationTest, activation)

// Where a careless exponential overflows, what comes back is dy or 0.
TEST_P(ActivationTest, LargeValuesAreFinite) {
  std::vector<float> x{1e30f, -1e30f, 3e38f, -3e38f};
  const std::size_t beyond = x.size();
  for (int i = -200; i <= 200; ++i) x.push_back(static_cast<float>(i));
  const auto n = static_cast<long>(x.size());
  for (const Activation act : kAll) {
    const Tensor dx = ctx().upload({n}, std::vector<float>(x.size(), 1.0f));
    activation_backward(ctx(), {ctx().upload({n}, x), act, dx, dx});
    const auto got = ctx().read<float>(dx);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double want = i < beyond ? (x[i] > 0 ? 1 : 0) : ref::activation_slope(x[i], static_cast<int>(act));
      EXPECT_NEAR(got[i], want, 1e-6) << x[i] << " act " << static_cast<int>(act);
    }
  }
}

// As PyTorch has it: nothing comes back where ReLU begins.
TEST_P(ActivationTest, ReluHasNoSlopeAtZero) {
  const Tensor x = ctx().upload({2}, std::vector<float>{0.0f, -0.0f}), d = ctx().upload({2}, std::vector<float>{1, 1});
  activation_backward(ctx(), {x, Activation::relu, d, d});
  EXPECT_EQ(ctx().read<float>(d), (std::vector<float>{0, 0}));
}

TEST_P(ActivationTest, ReluKeepsWhatIsNoNumber) {
  const Tensor x = ctx().upload({3}, std::vector<float>{-1, NAN, 2});
  activation_forward(ctx(), {x, Activation::relu, x});
  const auto got = ctx().read<float>(x);
  EXPECT_EQ(got[0], 0);
  EXPECT_TRUE(std::isnan(got[1]));
  EXPECT_EQ(got[2], 2);
}

TEST_P(ActivationTest, EmptyInput) {
  const Tensor none = ctx().tensor({0});
  EXPECT_NO_THROW(activation_forward(ctx(), {none, Activation::gelu, none}));
  EXPECT_NO_THROW(activation_backward(ctx(), {none, Activation::gelu, none, none}));
}

TEST_P(ActivationTest, RejectsBadShape) {
  const Tensor x = ctx().tensor({3}), y = ctx().tensor({4});
  EXPECT_THROW(activation_forward(ctx(), {x, Activation::gelu, y}), Error);
  EXPECT_THROW(activation_forward(ctx(), {x, Activation::none, x}), Error);
  EXPECT_THROW(activation_backward(ctx(), {x, Activation::gelu, y, x}), Error);
}

}  // namespace
}  // namespace vsplat
