#include "model/diagnose/selftest/reference/attention.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/pairs.h"
#include "model/ops/dense/attention.h"

namespace vsplat::selftest {
namespace {

// The tolerances: of the forward, of the backward.
void attention_of(Checks& c, const std::vector<float>& qkv, long v, long t, long h, long d, double there, double back) {
  const auto dout = random_floats(size_of(v * t, h * d), static_cast<std::uint32_t>(t + d));
  const AttentionForward f{c.up({v, t, 3, h, d}, qkv), c.gap({v, t, h * d}), c.gap({v, h, t, 2})};
  attention_forward(c.ctx, f);
  c.close(
      "forward", f.out, [&] { return ref::attention(qkv, v, t, h, d); }, there);
  c.keep();  // statistics
  const AttentionBackward b{f.qkv, f.out, f.stats, c.up({v, t, h * d}, dout), c.gap({v, t, 3, h, d})};
  attention_backward(c.ctx, b);
  // q, k and v by themselves: the gradient by v may be many times the others. One token has one weight, 1.
  const auto got = c.ctx.read<float>(b.dqkv);
  const auto want = ref::attention_backward(qkv, v, t, h, d, as_doubles(dout));
  for (std::size_t which = t > 1 ? 0 : 2; which < 3; ++which) {
    std::vector<float> some;
    std::vector<double> expected;
    for (std::size_t i = 0; i < want.size(); ++i)
      if (i / size_of(h, d) % 3 == which) some.push_back(got[i]), expected.push_back(want[i]);
    c.close("backward", some, expected, back);
  }
  if (!c.all) return;
  const Tensor out = c.gap(f.out.shape());
  attention_forward(c.ctx, {f.qkv, out, {}});
  c.close(
      "forward, without statistics", out, [&] { return ref::attention(qkv, v, t, h, d); }, there);
}

void attention_of(Checks& c, long v, long t, long h, long d, float reach, double back = 0) {
  const auto qkv = random_floats(size_of(v * t, 3 * h * d), static_cast<std::uint32_t>(t * 10 + d), -reach, reach);
  attention_of(c, qkv, v, t, h, d, 1e-5, back > 0 ? back : c.within(2e-5, 1e-5));
}

void attention_all(Checks& c) {
  for (const long t : c.some({1L, 3L, 11L, 12L, 13L, 31L, 32L, 33L, 63L, 65L, 127L, 129L, 157L}, {128L}))
    attention_of(c, 2, t, 3, 8, 1.5f);
  for (const long d : c.some({1L, 7L, 16L, 17L, 31L, 64L, 70L}, {6L})) attention_of(c, 1, 37, 2, d, 1.5f);
  if (!c.all) return;
  attention_of(c, 1, 145, 2, 32, 1.5f);
  attention_of(c, 2, 45, 2, 64, 3.0f);
  // Scores up to hundreds, where exp alone overflows, and one key per query that takes nearly all. The gradient's
  // tolerance is the last bit of the largest score in units of ln 2: that much of a weight is not known.
  attention_of(c, 1, 140, 2, 8, 20.0f, 9.12e-5);
  attention_of(c, 1, 50, 1, 6, 100.0f, 2.09e-3);
  // The largest score comes last, so that every step rescales what came before. Then all scores are far below zero: a
  // padding key would have the largest score, and 2^128 of it is not finite.
  auto rising = random_floats(200 * 3 * 8, 3), below = random_floats(157 * 3 * 8, 6);
  for (std::size_t i = 0; i < 200; ++i) rising[i * 24] = 3, rising[i * 24 + 8] = 0.2f * static_cast<float>(i);
  for (std::size_t i = 0; i < 157; ++i) {
    below[i * 24] = 14 + 0.05f * static_cast<float>(i), below[i * 24 + 8] = -16 + 0.1f * static_cast<float>(i % 7);
  }
  attention_of(c, rising, 1, 200, 1, 8, 1e-5, 2e-5);
  attention_of(c, below, 1, 157, 1, 8, 2.13e-5, 2.13e-5);
}

// Pairs of rounded operands in the cpu flavour. A score is off by 2^-8 of its terms' magnitudes, and a weight by as
// much as a score.
void attention_pairs_all(Checks& c) {
  if (!multiplies_pairs(c)) return;
  const AlwaysPairs always;
  for (const auto& [t, d] :
       c.some({std::array<long, 2>{1, 8}, {3, 7}, {12, 1}, {13, 17}, {31, 16}, {33, 31}, {129, 64}, {145, 70}},
              {{11, 2}, {32, 32}, {65, 33}, {128, 6}, {157, 8}})) {
    const auto qkv = random_floats(static_cast<std::size_t>(2 * t * 3 * 3 * d), 7, -1.5f, 1.5f);
    const AttentionForward f{c.up({2, t, 3, 3, d}, qkv), c.gap({2, t, 3 * d}), c.gap({2, 3, t, 2})};
    attention_forward(c.ctx, f);
    c.close(
        "pairs, forward", f.out, [&, t = t, d = d] { return ref::attention(qkv, 2, t, 3, d); }, 2e-2);
    c.keep();
    const auto dout = random_floats(static_cast<std::size_t>(2 * t * 3 * d), 8);
    const AttentionBackward b{f.qkv, f.out, f.stats, c.up({2, t, 3 * d}, dout), c.gap({2, t, 3, 3, d})};
    attention_backward(c.ctx, b);
    c.close(
        "pairs, backward", b.dqkv,
        [&, t = t, d = d] { return ref::attention_backward(qkv, 2, t, 3, d, as_doubles(dout)); }, 2e-2);
  }
}

}  // namespace

VSPLAT_CASES(attention, {"attention", attention_all}, {"attention_pairs", attention_pairs_all})

}  // namespace vsplat::selftest
