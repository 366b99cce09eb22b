#include "model/ops/dense/layernorm.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/layernorm.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class LayerNorm : public test::FlavourTest {};
VSPLAT_FLAVOURS(LayerNorm);
VSPLAT_OPERATION(LayerNorm, layernorm)

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(LayerNormReference, GradientsAreThoseOfDifferences) {
  for (const std::size_t c : {1U, 2U, 7U, 24U}) {
    const auto gamma = test::random_floats(c, 2, 0.5f, 1.5f);
    auto x = test::random_doubles(3 * c, 1, -2, 3), beta = test::random_doubles(c, 3),
         wide_gamma = test::as_doubles(gamma);
    const auto dy = test::random_doubles(3 * c, 4);
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

// One channel is its own mean. What reaches x is then rounding, of numbers as large as dy / sqrt(eps).
TEST_P(LayerNorm, GradientOfOneChannelIsZero) {
  const Tensor x = ctx().upload({65, 1}, test::random_floats(65, 1)), one = ctx().upload({1}, std::vector<float>{1.3f});
  const Tensor dy = ctx().upload({65, 1}, test::random_floats(65, 2)), dx = ctx().upload({65, 1}, test::nans(65));
  layernorm_backward(ctx(), {x, one, 1e-6f, dy, dx, ctx().upload({1}, std::vector<float>{0}),
                             ctx().upload({1}, std::vector<float>{0})});
  for (const float v : ctx().read<float>(dx)) EXPECT_NEAR(v, 0, 1e-6 / std::sqrt(1e-6));
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
