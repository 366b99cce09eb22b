#include "model/ops/attention.h"

#include "tests/reference/attention.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

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

// Tiles are 12 queries by panels of 32 keys, 4 panels a step (cpu); 64 by 32 (gpu).
TEST_P(Attention, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const long t : {1L, 3L, 11L, 12L, 13L, 31L, 32L, 33L, 63L, 65L, 127L, 128L, 129L, 157L}) check(2, t, 3, 8);
}

TEST_P(Attention, EveryHeadDimension) {
  for (const long d : {1L, 6L, 7L, 16L, 17L, 31L}) check(1, 37, 2, d);
  check(2, 45, 2, 64, 3.0f);
  check(1, 33, 1, 70);
}

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

TEST_P(Attention, IsDeterministic) {
  const auto qkv = test::random_floats(2 * 77 * 3 * 2 * 8, 4);
  EXPECT_EQ(run(qkv, 2, 77, 2, 8), run(qkv, 2, 77, 2, 8));
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

}  // namespace
}  // namespace vsplat
