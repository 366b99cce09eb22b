#include "model/ops/layernorm.h"

#include "tests/reference/layernorm.h"
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

TEST_P(LayerNorm, EmptyInput) {
  const Tensor none = ctx().tensor({0, 4}), four = ctx().tensor({4});
  layernorm_forward(ctx(), {none, four, four, 1e-6f, none});
}

TEST_P(LayerNorm, RejectsBadShape) {
  const Tensor x = ctx().tensor({3, 4}), four = ctx().tensor({4}), five = ctx().tensor({5});
  EXPECT_THROW(layernorm_forward(ctx(), {x, four, five, 1e-6f, x}), Error);
  const Tensor tokens = ctx().tensor({1, 4, 4}), film = ctx().tensor({1, 3, 8}), out = ctx().tensor({1, 3, 4});
  EXPECT_THROW(modulate_forward(ctx(), {out, four, four, film, 1e-6f, out}), Error);
  EXPECT_THROW(modulate_forward(ctx(), {tokens, four, four, out, 1e-6f, out}), Error);
}

}  // namespace
}  // namespace vsplat
