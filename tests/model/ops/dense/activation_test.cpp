#include "model/ops/dense/activation.h"

#include <fmt/format.h>

#include "model/diagnose/selftest/reference/activation.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

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

class ActivationTest : public test::FlavourTest {
 protected:
  void expect_match(const std::vector<float>& x, double tolerance) {
    const auto n = static_cast<long>(x.size());
    const auto dy = test::random_floats(x.size(), 2, 0.5f, 1.0f);
    for (const Activation act : kAll) {
      SCOPED_TRACE(fmt::format("{} values, act {}", n, static_cast<int>(act)));
      std::vector<double> y, by_x;
      for (std::size_t i = 0; i < x.size(); ++i) {
        y.push_back(ref::activate(x[i], static_cast<int>(act)));
        by_x.push_back(dy[i] * ref::activation_slope(x[i], static_cast<int>(act)));
      }
      const Tensor in = ctx().upload({n}, x), up = ctx().upload({n}, dy), out = ctx().upload({n}, test::nans(x.size()));
      activation_forward(ctx(), {in, act, out});
      EXPECT_TRUE(test::close(ctx().read<float>(out), y, tolerance));
      ctx().write(out, test::nans(x.size()).data());
      activation_backward(ctx(), {in, act, up, out});
      EXPECT_TRUE(test::close(ctx().read<float>(out), by_x, tolerance));
      activation_backward(ctx(), {in, act, up, up});
      EXPECT_EQ(ctx().read<float>(up), ctx().read<float>(out)) << "in place";
      activation_forward(ctx(), {in, act, in});
      EXPECT_TRUE(test::close(ctx().read<float>(in), y, tolerance)) << "in place";
    }
  }
};
VSPLAT_FLAVOURS(ActivationTest);

TEST_P(ActivationTest, EverySizeMatchesReference) {
  for (const std::size_t n : {1U, 3U, 7U, 15U, 16U, 17U, 101U, 1023U, 1024U, 1025U, 3001U}) {
    auto x = test::random_floats(n, 1, -5, 5);
    x[0] = 2;  // one slope of about 1, by which all are measured: where it crosses 0 it is a difference of such numbers
    expect_match(x, 1e-6);
  }
}

// Over the range in which they are neither 0 nor x.
TEST_P(ActivationTest, ExactEverywhere) {
  std::vector<float> x(4000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = -16.0f + 0.008f * static_cast<float>(i);
  expect_match(x, 1e-6);
}

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
