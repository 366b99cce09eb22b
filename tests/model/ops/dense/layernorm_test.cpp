#include "model/ops/dense/layernorm.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/layernorm.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class LayerNorm : public test::FlavourTest {
 protected:
  void check(const std::vector<float>& x, long rows, long c, double tolerance) {
    const auto n = static_cast<std::size_t>(c);
    const auto gamma = test::random_floats(n, 5, 0.5f, 1.5f), beta = test::random_floats(n, 6);
    LayerNormForward a{ctx().upload({rows, c}, x), ctx().upload({c}, gamma), ctx().upload({c}, beta), 1e-6f,
                       ctx().upload({rows, c}, test::nans(x.size()))};
    layernorm_forward(ctx(), a);
    const auto want = ref::layernorm(x, n, gamma, beta, 1e-6);
    EXPECT_TRUE(test::close(ctx().read<float>(a.out), want, tolerance)) << rows << " x " << c;
    a.out = a.x;  // in place
    layernorm_forward(ctx(), a);
    EXPECT_TRUE(test::close(ctx().read<float>(a.x), want, tolerance)) << rows << " x " << c << " in place";
  }
};
VSPLAT_FLAVOURS(LayerNorm);
VSPLAT_OPERATION(LayerNorm, layernorm)

// Without weights: as with ones and zeros, there and back.
TEST_P(LayerNorm, WithoutWeights) {
  for (const long c : {3L, 16L, 33L, 96L, 161L}) {
    SCOPED_TRACE(c);
    constexpr long rows = 7;
    const auto n = static_cast<std::size_t>(c);
    const auto x = test::random_floats(rows * n, 5, -2, 3), dy = test::random_floats(rows * n, 6);
    const std::vector<float> ones(n, 1.0f), zeros(n, 0.0f);
    const Tensor in = ctx().upload({rows, c}, x), out = ctx().upload({rows, c}, test::nans(x.size()));
    layernorm_forward(ctx(), {in, {}, {}, 1e-5f, out});
    EXPECT_TRUE(test::close(ctx().read<float>(out), ref::layernorm(x, n, ones, zeros, 1e-5), 1e-5));
    const auto want = ref::layernorm_backward(x, n, ones, 1e-5, std::vector<double>(dy.begin(), dy.end()));
    const Tensor dx = ctx().upload({rows, c}, test::nans(x.size()));
    layernorm_backward(ctx(), {in, {}, 1e-5f, ctx().upload({rows, c}, dy), dx, {}, {}});
    EXPECT_TRUE(test::close(ctx().read<float>(dx), want.x, 1e-5));
  }
}

// Values far from zero with a small deviation: float32 itself keeps them to 3 * 6e-8 / 0.01 of the deviation.
TEST_P(LayerNorm, MeansFarFromZeroWithSmallVariance) {
  auto x = test::random_floats(5 * 96, 7, -0.01f, 0.01f);
  for (float& v : x) v += 3.0f;
  check(x, 5, 96, 1e-4);
}

// eps is what keeps equal values from dividing by zero, and shows where the deviation is as small.
TEST_P(LayerNorm, EpsilonCounts) { check(test::random_floats(4 * 40, 8, -1e-3f, 1e-3f), 4, 40, 1e-5); }

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(LayerNormReference, GradientsAreThoseOfDifferences) {
  for (const std::size_t c : {1U, 2U, 7U, 24U}) {
    const auto doubles = [](const std::vector<float>& v) { return std::vector<double>(v.begin(), v.end()); };
    const auto gamma = test::random_floats(c, 2, 0.5f, 1.5f);
    auto x = doubles(test::random_floats(3 * c, 1, -2, 3)), beta = doubles(test::random_floats(c, 3));
    auto wide_gamma = doubles(gamma);
    const auto dy = doubles(test::random_floats(3 * c, 4));
    const auto want = ref::layernorm_backward(x, c, gamma, 1e-3, dy);
    const auto differences = [&](std::vector<double>& by) {
      return ref::central_differences(by, 1e-5,
                                      [&] { return ref::weighed(ref::layernorm(x, c, wide_gamma, beta, 1e-3), dy); });
    };
    EXPECT_TRUE(test::close(want.x, differences(x), 1e-7, c == 1)) << c;
    EXPECT_TRUE(test::close(want.gamma, differences(wide_gamma), 1e-7, c == 1)) << c;
    EXPECT_TRUE(test::close(want.beta, differences(beta), 1e-7)) << c;
  }
}

class LayerNormGradient : public test::FlavourTest {
 protected:
  void check(const std::vector<float>& x, long rows, long c, double tolerance) {
    SCOPED_TRACE(std::to_string(rows) + " x " + std::to_string(c));
    const auto n = static_cast<std::size_t>(c);
    const auto gamma = test::random_floats(n, 5, 0.5f, 1.5f), dy = test::random_floats(x.size(), 6);
    const auto want = ref::layernorm_backward(x, n, gamma, 1e-6, std::vector<double>(dy.begin(), dy.end()));
    const auto before = test::random_floats(x.size(), 7), some = test::random_floats(n, 8);
    for (const bool add : {false, true}) {
      const LayerNormBackward a{ctx().upload({rows, c}, x),
                                ctx().upload({c}, gamma),
                                1e-6f,
                                ctx().upload({rows, c}, dy),
                                ctx().upload({rows, c}, add ? before : test::nans(x.size())),
                                ctx().upload({c}, some),
                                ctx().upload({c}, some),
                                add};
      layernorm_backward(ctx(), a);
      EXPECT_TRUE(test::close(ctx().read<float>(a.dx), add ? selftest::plus(want.x, before) : want.x, tolerance));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dgamma), selftest::plus(want.gamma, some), tolerance));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dbeta), selftest::plus(want.beta, some), tolerance));
    }
  }
};
VSPLAT_FLAVOURS(LayerNormGradient);

// One channel is its own mean. What reaches x is then rounding, of numbers as large as dy / sqrt(eps).
TEST_P(LayerNormGradient, OfOneChannelIsZero) {
  const Tensor x = ctx().upload({65, 1}, test::random_floats(65, 1)), one = ctx().upload({1}, std::vector<float>{1.3f});
  const Tensor dy = ctx().upload({65, 1}, test::random_floats(65, 2)), dx = ctx().upload({65, 1}, test::nans(65));
  layernorm_backward(ctx(), {x, one, 1e-6f, dy, dx, ctx().upload({1}, std::vector<float>{0}),
                             ctx().upload({1}, std::vector<float>{0})});
  for (const float v : ctx().read<float>(dx)) EXPECT_NEAR(v, 0, 1e-6 / std::sqrt(1e-6));
}

// As for forward: float32 itself keeps such values to 2e-5 of their deviation.
TEST_P(LayerNormGradient, MeansFarFromZeroWithSmallVariance) {
  auto x = test::random_floats(5 * 96, 7, -0.01f, 0.01f);
  for (float& v : x) v += 3.0f;
  check(x, 5, 96, 1e-4);
}

// Nothing is computed, and nothing is added to the parameters' gradients.
TEST_P(LayerNorm, EmptyInput) {
  const std::vector<float> before{1, -2, 3, 4};
  const Tensor none = ctx().tensor({0, 4}), gamma = ctx().upload({4}, before);
  layernorm_forward(ctx(), {none, gamma, gamma, 1e-6f, none});
  const Tensor dgamma = ctx().upload({4}, before), dbeta = ctx().upload({4}, before);
  for (const bool add : {false, true}) layernorm_backward(ctx(), {none, gamma, 1e-6f, none, none, dgamma, dbeta, add});
  EXPECT_EQ(ctx().read<float>(dgamma), before);
  EXPECT_EQ(ctx().read<float>(dbeta), before);
}

TEST_P(LayerNorm, RejectsBadShape) {
  const Tensor x = ctx().tensor({3, 4}), four = ctx().tensor({4}), five = ctx().tensor({5});
  EXPECT_THROW(layernorm_forward(ctx(), {x, four, five, 1e-6f, x}), Error);
  EXPECT_THROW(layernorm_backward(ctx(), {x, four, 1e-6f, x, x, four, five}), Error);
  EXPECT_THROW(layernorm_forward(ctx(), {x, {}, four, 1e-6f, x}), Error);
  EXPECT_THROW(layernorm_backward(ctx(), {x, four, 1e-6f, x, x, {}, {}}), Error);
  const Tensor tokens = ctx().tensor({1, 4, 4}), film = ctx().tensor({1, 3, 8}), out = ctx().tensor({1, 3, 4});
  EXPECT_THROW(modulate_forward(ctx(), {out, four, four, film, 1e-6f, out}), Error);
  EXPECT_THROW(modulate_forward(ctx(), {tokens, four, four, out, 1e-6f, out}), Error);
  EXPECT_THROW(modulate_backward(ctx(), {tokens, four, four, film, 1e-6f, out, out, film, four, four}), Error);
}

}  // namespace
}  // namespace vsplat
