#include "model/ops/dense/attention.h"

#include <fmt/format.h>

#include <array>

#include "model/diagnose/selftest/reference/attention.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Attention : public test::FlavourTest {
 protected:
  std::vector<float> run(const std::vector<float>& qkv, long v, long t, long h, long d) {
    AttentionForward a;
    a.qkv = ctx().upload({v, t, 3, h, d}, qkv);
    a.out = ctx().upload({v, t, h * d}, test::nans(static_cast<std::size_t>(v * t * h * d)));
    attention_forward(ctx(), a);
    return ctx().read<float>(a.out);
  }

  void check(long v, long t, long h, long d, float reach = 1.5f) {
    const auto qkv = test::random_floats(static_cast<std::size_t>(v * t * 3 * h * d),
                                         static_cast<std::uint32_t>(t * 10 + d), -reach, reach);
    // Weights and sums of float32: a few times 1e-7.
    EXPECT_TRUE(test::close(run(qkv, v, t, h, d), ref::attention(qkv, v, t, h, d), 1e-5))
        << v << " views, " << t << " tokens, " << h << " heads of " << d;
  }
};
VSPLAT_FLAVOURS(Attention);
VSPLAT_OPERATION(Attention, attention)

// Scores up to hundreds, where exp alone overflows, and one key per query that takes nearly all.
TEST_P(Attention, LargeScores) {
  check(1, 140, 2, 8, 20.0f);
  check(1, 50, 1, 6, 100.0f);
}

// The largest score comes last, so that every step rescales what came before.
TEST_P(Attention, RisingScores) {
  const long t = 200, d = 8;
  std::vector<float> qkv = test::random_floats(static_cast<std::size_t>(t * 3 * d), 3);
  for (long i = 0; i < t; ++i) {
    qkv[static_cast<std::size_t>(i * 3 * d)] = 3.0f;
    qkv[static_cast<std::size_t>((i * 3 + 1) * d)] = 0.2f * static_cast<float>(i);
  }
  EXPECT_TRUE(test::close(run(qkv, 1, t, 1, d), ref::attention(qkv, 1, t, 1, d), 1e-5));
}

TEST_P(Attention, NonFiniteInputStaysInItsView) {
  auto qkv = test::random_floats(2 * 20 * 3 * 2 * 8, 5);
  const std::vector<float> clean = run(qkv, 2, 20, 2, 8);
  qkv[17] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> out = run(qkv, 2, 20, 2, 8);
  for (std::size_t i = out.size() / 2; i < out.size(); ++i) ASSERT_EQ(out[i], clean[i]);
}

TEST_P(Attention, EmptyInput) { EXPECT_TRUE(run({}, 0, 5, 2, 8).empty()); }

TEST_P(Attention, RejectsBadShape) {
  AttentionForward a;
  a.qkv = ctx().tensor({1, 4, 3, 2, 8});
  a.out = ctx().tensor({1, 4, 15});
  EXPECT_THROW(attention_forward(ctx(), a), Error);
  a.out = ctx().tensor({1, 5, 16});
  EXPECT_THROW(attention_forward(ctx(), a), Error);
}

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(AttentionReference, GradientsAreThoseOfDifferences) {
  for (const auto& [v, t, h, d] : {std::array<long, 4>{1, 2, 1, 1}, {2, 5, 2, 3}, {1, 7, 1, 4}}) {
    const auto doubles = [](const std::vector<float>& values) {
      return std::vector<double>(values.begin(), values.end());
    };
    auto qkv = doubles(test::random_floats(static_cast<std::size_t>(v * t * 3 * h * d), 1, -1.5f, 1.5f));
    const auto dout = doubles(test::random_floats(static_cast<std::size_t>(v * t * h * d), 2));
    const auto want = ref::attention_backward(qkv, v, t, h, d, dout);
    const auto loss = [&, v = v, t = t, h = h, d = d] { return ref::weighed(ref::attention(qkv, v, t, h, d), dout); };
    const std::vector<double> slopes = ref::central_differences(qkv, 1e-5, loss);
    EXPECT_TRUE(test::close(want, slopes, 1e-7)) << v << " " << t << " " << h << " " << d;
  }
}

class AttentionGradient : public test::FlavourTest {
 protected:
  std::vector<float> run(const std::vector<float>& qkv, const std::vector<float>& dout, long v, long t, long h,
                         long d) {
    AttentionForward f;
    f.qkv = ctx().upload({v, t, 3, h, d}, qkv);
    f.out = ctx().upload({v, t, h * d}, test::nans(dout.size()));
    f.stats = ctx().upload({v, h, t, 2}, test::nans(static_cast<std::size_t>(v * h * t * 2)));
    attention_forward(ctx(), f);
    AttentionBackward b{f.qkv, f.out, f.stats, ctx().upload({v, t, h * d}, dout),
                        ctx().upload({v, t, 3, h, d}, test::nans(qkv.size()))};
    attention_backward(ctx(), b);
    return ctx().read<float>(b.dqkv);
  }

  // q, k and v separately: the gradient by v may be many times the others.
  static std::vector<double> part(const std::vector<double>& all, long which, long row) {
    std::vector<double> out;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (static_cast<long>(i) / row % 3 == which) out.push_back(all[i]);
    return out;
  }

  // A float of the size of the largest score, in units of ln 2, has this for its last bit: that much of a weight, and
  // of the gradients, is not known.
  static double last_bit(const std::vector<float>& qkv, long v, long t, long h, long d) {
    double largest = 0;
    const auto at = [&](long token, long which, long head, long c) {
      return static_cast<double>(qkv[static_cast<std::size_t>(((token * 3 + which) * h + head) * d + c)]);
    };
    for (long i = 0; i < v * t; ++i)
      for (long j = i / t * t; j < (i / t + 1) * t; ++j)
        for (long head = 0; head < h; ++head) {
          double score = 0;
          for (long c = 0; c < d; ++c) score += at(i, 0, head, c) * at(j, 1, head, c);
          largest = std::max(largest, std::abs(score) / std::sqrt(static_cast<double>(d)) / std::log(2.0));
        }
    return largest * 0x1p-23;
  }

  void check(const std::vector<float>& qkv, long v, long t, long h, long d) {
    SCOPED_TRACE(fmt::format("{} views, {} tokens, {} heads of {}", v, t, h, d));
    const auto dout = test::random_floats(static_cast<std::size_t>(v * t * h * d), static_cast<std::uint32_t>(t + d));
    const auto got = run(qkv, dout, v, t, h, d);
    const auto want = ref::attention_backward(qkv, v, t, h, d, std::vector<double>(dout.begin(), dout.end()));
    const std::vector<double> wide(got.begin(), got.end());
    const double tolerance = std::max(1e-5, last_bit(qkv, v, t, h, d));
    for (const long which : {0L, 1L, 2L})
      if (t > 1 || which == 2) {
        EXPECT_TRUE(test::close(part(wide, which, h * d), part(want, which, h * d), tolerance)) << "qkv"[which];
      } else {  // one token has one weight, 1, whatever q and k
        for (const double each : part(wide, which, h * d)) EXPECT_NEAR(each, 0, tolerance) << "qkv"[which];
      }
  }

  void check(long v, long t, long h, long d, float reach = 1.5f) {
    check(test::random_floats(static_cast<std::size_t>(v * t * 3 * h * d), static_cast<std::uint32_t>(t * 10 + d),
                              -reach, reach),
          v, t, h, d);
  }
};
VSPLAT_FLAVOURS(AttentionGradient);

// If one key takes nearly all of a query's weight, the rest of the gradient is a difference of nearly equal numbers.
TEST_P(AttentionGradient, LargeScores) {
  check(1, 140, 2, 8, 20.0f);
  check(1, 50, 1, 6, 100.0f);
}

// All scores are far below zero: a padding key would have the largest score, and 2^128 of it is not finite.
TEST_P(AttentionGradient, ScoresFarBelowZero) {
  const long t = 157, d = 8;
  auto qkv = test::random_floats(static_cast<std::size_t>(t * 3 * d), 6);
  for (long i = 0; i < t; ++i) {
    qkv[static_cast<std::size_t>(i * 3 * d)] = 14.0f + 0.05f * static_cast<float>(i);
    qkv[static_cast<std::size_t>((i * 3 + 1) * d)] = -16.0f + 0.1f * static_cast<float>(i % 7);
  }
  check(qkv, 1, t, 1, d);
}

// With one token its weight is 1, and what the score is does not matter; what is left is the rounding of dout (v - v).
TEST_P(AttentionGradient, OfOneTokenIsThatOfItsValue) {
  const auto qkv = test::random_floats(3 * 2 * 8, 7), dout = test::random_floats(2 * 8, 8);
  const std::vector<float> got = run(qkv, dout, 1, 1, 2, 8);
  for (std::size_t i = 0; i < 32; ++i) EXPECT_NEAR(got[i], 0, 2e-6);
  EXPECT_TRUE(test::close(std::vector<float>(got.begin() + 32, got.end()), dout, 1e-6));
}

TEST_P(AttentionGradient, NonFiniteInputStaysInItsView) {
  auto qkv = test::random_floats(2 * 20 * 3 * 2 * 8, 5);
  const auto dout = test::random_floats(2 * 20 * 2 * 8, 6);
  const std::vector<float> clean = run(qkv, dout, 2, 20, 2, 8);
  qkv[17] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> got = run(qkv, dout, 2, 20, 2, 8);
  for (std::size_t i = got.size() / 2; i < got.size(); ++i) ASSERT_EQ(got[i], clean[i]);
}

TEST_P(AttentionGradient, EmptyInput) { EXPECT_TRUE(run({}, {}, 0, 5, 2, 8).empty()); }

TEST_P(AttentionGradient, RejectsBadShape) {
  const Tensor qkv = ctx().tensor({1, 4, 3, 2, 8}), out = ctx().tensor({1, 4, 16}), stats = ctx().tensor({1, 2, 4, 2});
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, {}, out, qkv}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, ctx().tensor({1, 4, 2, 2}), out, qkv}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, stats, ctx().tensor({1, 4, 15}), qkv}), Error);
  EXPECT_THROW(attention_backward(ctx(), {qkv, out, stats, out, ctx().tensor({1, 4, 3, 8, 2})}), Error);
}

}  // namespace
}  // namespace vsplat
