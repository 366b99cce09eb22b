#include "model/ops/dense/attention.h"

#include <array>

#include "model/diagnose/selftest/reference/attention.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Attention : public test::FlavourTest {
 protected:
  // The output without and with statistics, and the gradient.
  std::array<std::vector<float>, 3> run(const std::vector<float>& qkv, const std::vector<float>& dout, long v, long t,
                                        long h, long d) {
    AttentionForward f;
    f.qkv = ctx().upload({v, t, 3, h, d}, qkv);
    f.out = ctx().upload({v, t, h * d}, test::nans(dout.size()));
    attention_forward(ctx(), f);
    const auto plain = ctx().read<float>(f.out);
    f.stats = ctx().upload({v, h, t, 2}, test::nans(static_cast<std::size_t>(v * h * t * 2)));
    attention_forward(ctx(), f);
    const AttentionBackward b{f.qkv, f.out, f.stats, ctx().upload({v, t, h * d}, dout),
                              ctx().upload({v, t, 3, h, d}, test::nans(qkv.size()))};
    attention_backward(ctx(), b);
    return {plain, ctx().read<float>(f.out), ctx().read<float>(b.dqkv)};
  }
};
VSPLAT_FLAVOURS(Attention);
VSPLAT_OPERATION(Attention, attention)

// With one token its weight is 1, and what the score is does not matter; what is left is the rounding of dout (v - v).
TEST_P(Attention, GradientOfOneTokenIsThatOfItsValue) {
  const auto qkv = test::random_floats(3 * 2 * 8, 7), dout = test::random_floats(2 * 8, 8);
  const std::vector<float> got = run(qkv, dout, 1, 1, 2, 8)[2];
  for (std::size_t i = 0; i < 32; ++i) EXPECT_NEAR(got[i], 0, 2e-6);
  EXPECT_TRUE(test::close(std::vector<float>(got.begin() + 32, got.end()), dout, 1e-6));
}

TEST_P(Attention, NonFiniteInputStaysInItsView) {
  auto qkv = test::random_floats(2 * 20 * 3 * 2 * 8, 5);
  const auto dout = test::random_floats(2 * 20 * 2 * 8, 6);
  const auto clean = run(qkv, dout, 2, 20, 2, 8);
  qkv[17] = std::numeric_limits<float>::quiet_NaN();
  const auto got = run(qkv, dout, 2, 20, 2, 8);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = got[k].size() / 2; i < got[k].size(); ++i) ASSERT_EQ(got[k][i], clean[k][i]);
}

TEST_P(Attention, EmptyInput) {
  for (const auto& got : run({}, {}, 0, 5, 2, 8)) EXPECT_TRUE(got.empty());
}

TEST_P(Attention, RejectsBadShape) {
  const Tensor qkv = ctx().tensor({1, 4, 3, 2, 8}), out = ctx().tensor({1, 4, 16}), stats = ctx().tensor({1, 2, 4, 2});
  EXPECT_THROW(attention_forward(ctx(), {qkv, ctx().tensor({1, 4, 15}), {}}), Error);
  EXPECT_THROW(attention_forward(ctx(), {qkv, ctx().tensor({1, 5, 16}), {}}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, {}, out, qkv}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, ctx().tensor({1, 4, 2, 2}), out, qkv}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, stats, ctx().tensor({1, 4, 15}), qkv}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, stats, out, ctx().tensor({1, 4, 3, 8, 2})}), Error);
}

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(AttentionReference, GradientsAreThoseOfDifferences) {
  for (const auto& [v, t, h, d] : {std::array<long, 4>{1, 2, 1, 1}, {2, 5, 2, 3}, {1, 7, 1, 4}}) {
    auto qkv = test::random_doubles(static_cast<std::size_t>(v * t * 3 * h * d), 1, -1.5f, 1.5f);
    const auto dout = test::random_doubles(static_cast<std::size_t>(v * t * h * d), 2);
    const auto want = ref::attention_backward(qkv, v, t, h, d, dout);
    const auto loss = [&, v = v, t = t, h = h, d = d] { return ref::weighed(ref::attention(qkv, v, t, h, d), dout); };
    const std::vector<double> slopes = ref::central_differences(qkv, 1e-5, loss);
    EXPECT_TRUE(test::close(want, slopes, 1e-7)) << v << " " << t << " " << h << " " << d;
  }
}

}  // namespace
}  // namespace vsplat
