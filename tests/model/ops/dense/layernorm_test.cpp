#include "model/ops/dense/layernorm.h"

#include "model/diagnose/selftest/reference/layernorm.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

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

TEST_P(LayerNorm, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const long c : {1L, 3L, 7L, 15L, 16L, 17L, 63L, 64L, 65L, 101L, 384L})
    for (const long rows : {1L, 3L, 67L})
      check(test::random_floats(static_cast<std::size_t>(rows * c), static_cast<std::uint32_t>(c), -2, 3), rows, c,
            1e-5);
}

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

TEST_P(LayerNorm, ModulatesEachTokenAndDropsTheFirst) {
  for (const auto& [v, p, c] : {std::array<long, 3>{1, 1, 6}, {2, 9, 24}, {3, 5, 37}}) {
    const auto n = static_cast<std::size_t>(c);
    const auto x = test::random_floats(static_cast<std::size_t>(v * (1 + p) * c), 9, -2, 2);
    const auto film = test::random_floats(static_cast<std::size_t>(v * p * 2 * c), 10);
    const auto gamma = test::random_floats(n, 11, 0.5f, 1.5f), beta = test::random_floats(n, 12);
    ModulateForward a{ctx().upload({v, 1 + p, c}, x),
                      ctx().upload({c}, gamma),
                      ctx().upload({c}, beta),
                      ctx().upload({v, p, 2 * c}, film),
                      1e-6f,
                      ctx().upload({v, p, c}, test::nans(static_cast<std::size_t>(v * p * c)))};
    modulate_forward(ctx(), a);
    const auto normed = ref::layernorm(x, n, gamma, beta, 1e-6);
    std::vector<double> want;
    for (long row = 0; row < v * p; ++row) {
      const std::size_t from = static_cast<std::size_t>((row / p) * (1 + p) + row % p + 1) * n;
      const std::size_t shift = static_cast<std::size_t>(row) * 2 * n;
      for (std::size_t i = 0; i < n; ++i)
        want.push_back(normed[from + i] * (1.0 + film[shift + n + i]) + film[shift + i]);
    }
    EXPECT_TRUE(test::close(ctx().read<float>(a.out), want, 1e-5)) << v << " " << p << " " << c;
  }
}

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(LayerNormReference, GradientsAreThoseOfDifferences) {
  for (const std::size_t c : {1U, 2U, 7U, 24U}) {
    const auto doubles = [](const std::vector<float>& v) { return std::vector<double>(v.begin(), v.end()); };
    const auto gamma = test::random_floats(c, 2, 0.5f, 1.5f);
    auto x = doubles(test::random_floats(3 * c, 1, -2, 3)), beta = doubles(test::random_floats(c, 3));
    auto wide_gamma = doubles(gamma);
    const auto dy = doubles(test::random_floats(3 * c, 4));
    const auto want = ref::layernorm_backward(x, c, gamma, 1e-3, dy);
    const auto difference = [&](double& at) {
      const auto loss = [&](double value) {
        at = value;
        const auto y = ref::layernorm(x, c, wide_gamma, beta, 1e-3);
        double sum = 0;
        for (std::size_t i = 0; i < y.size(); ++i) sum += dy[i] * y[i];
        return sum;
      };
      const double before = at, slope = (loss(before + 1e-5) - loss(before - 1e-5)) / 2e-5;
      at = before;
      return slope;
    };
    std::vector<double> by_x, by_gamma, by_beta;
    for (double& v : x) by_x.push_back(difference(v));
    for (double& v : wide_gamma) by_gamma.push_back(difference(v));
    for (double& v : beta) by_beta.push_back(difference(v));
    EXPECT_TRUE(test::close(want.x, by_x, 1e-7, c == 1)) << c;
    EXPECT_TRUE(test::close(want.gamma, by_gamma, 1e-7, c == 1)) << c;
    EXPECT_TRUE(test::close(want.beta, by_beta, 1e-7)) << c;
  }
}

class LayerNormGradient : public test::FlavourTest {
 protected:
  // What was in the gradients that are added to.
  static std::vector<double> plus(const std::vector<double>& a, const std::vector<float>& b) {
    std::vector<double> out(a);
    for (std::size_t i = 0; i < a.size(); ++i) out[i] += b[i];
    return out;
  }

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
      EXPECT_TRUE(test::close(ctx().read<float>(a.dx), add ? plus(want.x, before) : want.x, tolerance));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dgamma), plus(want.gamma, some), tolerance));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dbeta), plus(want.beta, some), tolerance));
    }
  }
};
VSPLAT_FLAVOURS(LayerNormGradient);

TEST_P(LayerNormGradient, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const long c : {3L, 7L, 15L, 16L, 17L, 63L, 64L, 65L, 101L, 384L})
    for (const long rows : {1L, 3L, 63L, 64L, 65L})
      check(test::random_floats(static_cast<std::size_t>(rows * c), static_cast<std::uint32_t>(c), -2, 3), rows, c,
            1e-5);
}

// One channel is its own mean. What reaches x is then rounding, of numbers as large as dy / sqrt(eps).
TEST_P(LayerNormGradient, OfOneChannelIsZero) {
  const Tensor x = ctx().upload({65, 1}, test::random_floats(65, 1)), one = ctx().upload({1}, std::vector<float>{1.3f});
  const Tensor dy = ctx().upload({65, 1}, test::random_floats(65, 2)), dx = ctx().upload({65, 1}, test::nans(65));
  layernorm_backward(ctx(), {x, one, 1e-6f, dy, dx, ctx().upload({1}, std::vector<float>{0}),
                             ctx().upload({1}, std::vector<float>{0})});
  for (const float v : ctx().read<float>(dx)) EXPECT_NEAR(v, 0, 1e-6 / std::sqrt(1e-6));
}

// More rows than sums of sums take in two steps.
TEST_P(LayerNormGradient, ManyRows) { check(test::random_floats(9001 * 5, 3, -2, 3), 9001, 5, 1e-5); }

// As for forward: float32 itself keeps such values to 2e-5 of their deviation.
TEST_P(LayerNormGradient, MeansFarFromZeroWithSmallVariance) {
  auto x = test::random_floats(5 * 96, 7, -0.01f, 0.01f);
  for (float& v : x) v += 3.0f;
  check(x, 5, 96, 1e-4);
}

TEST_P(LayerNormGradient, OfModulationAndOfDroppedTokens) {
  for (const auto& [v, p, c] : {std::array<long, 3>{1, 1, 6}, {2, 9, 24}, {3, 35, 37}}) {
    SCOPED_TRACE(std::to_string(v) + " x " + std::to_string(p) + " x " + std::to_string(c));
    const auto n = static_cast<std::size_t>(c), kept = static_cast<std::size_t>(v * p);
    const auto x = test::random_floats(static_cast<std::size_t>(v * (1 + p) * c), 9, -2, 2);
    const auto film = test::random_floats(kept * 2 * n, 10), dy = test::random_floats(kept * n, 13);
    const auto gamma = test::random_floats(n, 11, 0.5f, 1.5f), beta = test::random_floats(n, 12);
    // The loss by all tokens' normalised values: 0 for those that are dropped.
    const auto normed = ref::layernorm(x, n, gamma, beta, 1e-6);
    std::vector<double> by_normed(x.size()), by_film(film.size());
    for (std::size_t row = 0; row < kept; ++row) {
      const auto run = static_cast<std::size_t>(p), from = (row / run * (1 + run) + row % run + 1) * n;
      for (std::size_t i = 0; i < n; ++i) {
        by_normed[from + i] = dy[row * n + i] * (1.0 + film[row * 2 * n + n + i]);
        by_film[row * 2 * n + i] = dy[row * n + i];
        by_film[row * 2 * n + n + i] = dy[row * n + i] * normed[from + i];
      }
    }
    const auto want = ref::layernorm_backward(x, n, gamma, 1e-6, by_normed);
    const auto before = test::random_floats(x.size(), 7), some = test::random_floats(n, 8);
    for (const bool add : {false, true}) {
      const ModulateBackward a{ctx().upload({v, 1 + p, c}, x),
                               ctx().upload({c}, gamma),
                               ctx().upload({c}, beta),
                               ctx().upload({v, p, 2 * c}, film),
                               1e-6f,
                               ctx().upload({v, p, c}, dy),
                               ctx().upload({v, 1 + p, c}, add ? before : test::nans(x.size())),
                               ctx().upload({v, p, 2 * c}, test::nans(film.size())),
                               ctx().upload({c}, some),
                               ctx().upload({c}, some),
                               add};
      modulate_backward(ctx(), a);
      EXPECT_TRUE(test::close(ctx().read<float>(a.dx), add ? plus(want.x, before) : want.x, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dfilm), by_film, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dgamma), plus(want.gamma, some), 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(a.dbeta), plus(want.beta, some), 1e-5));
    }
  }
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
