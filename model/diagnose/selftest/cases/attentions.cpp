// Attention, of all tokens and in groups, and the turns of its queries and keys.
#include <algorithm>
#include <array>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/attention.h"
#include "model/diagnose/selftest/reference/cross_attention.h"
#include "model/diagnose/selftest/reference/rope.h"
#include "model/ops/dense/attention.h"
#include "model/ops/dense/cross_attention.h"
#include "model/ops/dense/rope.h"

namespace vsplat::selftest {
namespace {

void attention_of(Checks& c, long v, long t, long h, long d, float reach) {
  const auto size = [](long n) { return static_cast<std::size_t>(n); };
  const auto qkv = random_floats(size(v * t * 3 * h * d), static_cast<std::uint32_t>(t * 10 + d), -reach, reach);
  const auto dout = random_floats(size(v * t * h * d), static_cast<std::uint32_t>(t + d));
  const AttentionForward f{c.up({v, t, 3, h, d}, qkv), c.gap({v, t, h * d}), c.gap({v, h, t, 2})};
  attention_forward(c.ctx, f);
  c.close(
      "forward", f.out, [&] { return ref::attention(qkv, v, t, h, d); }, 1e-5);
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
      if (i / size(h * d) % 3 == which) some.push_back(got[i]), expected.push_back(want[i]);
    c.close("backward", some, expected, 2e-5);
  }
}

void attention_all(Checks& c) {
  for (const long t : c.some({1L, 3L, 11L, 12L, 13L, 31L, 32L, 33L, 63L, 65L, 127L, 129L, 157L}))
    attention_of(c, 2, t, 3, 8, 1.5f);
  for (const long d : c.some({1L, 7L, 16L, 17L, 31L, 64L, 70L})) attention_of(c, 1, 37, 2, d, 1.5f);
}

// Every row in one group, in another order where they are mapped.
std::vector<std::vector<int>> groups_of(Checks& c, long groups, long each, bool mapped, Tensor& map) {
  std::vector<int> rows(static_cast<std::size_t>(groups * each));
  std::iota(rows.begin(), rows.end(), 0);
  if (mapped) {
    std::shuffle(rows.begin(), rows.end(), std::mt19937(7));
    map = c.up({groups, each}, rows);
  }
  std::vector<std::vector<int>> out;
  for (auto at = rows.begin(); at != rows.end(); at += each) out.emplace_back(at, at + each);
  return out;
}

void cross_attention_all(Checks& c) {
  struct Try {
    long groups, l, s, heads, width;
    bool mapped;
  };
  for (const Try& t : c.some({Try{1, 1, 2, 1, 1, false},
                              {3, 1, 4, 2, 5, false},
                              {2, 7, 3, 3, 16, true},
                              {3, 8, 4, 2, 15, true},
                              {2, 3, 13, 1, 33, false},
                              {65, 2, 4, 2, 4, true}})) {
    const long wide = t.heads * t.width;
    const auto q = random_floats(static_cast<std::size_t>(t.groups * t.l * wide), 1),
               k = random_floats(static_cast<std::size_t>(t.groups * t.s * wide), 2), v = random_floats(k.size(), 3),
               dout = random_floats(q.size(), 4);
    ref::CrossAttentionCase want{static_cast<std::size_t>(t.heads),
                                 static_cast<std::size_t>(t.width),
                                 as_doubles(q),
                                 as_doubles(k),
                                 as_doubles(v),
                                 {},
                                 {},
                                 {},
                                 {}};
    CrossAttentionForward f;
    f.heads = t.heads, f.groups.l = t.l, f.groups.s = t.s;
    want.queries = groups_of(c, t.groups, t.l, t.mapped, f.groups.queries);
    want.keys = groups_of(c, t.groups, t.s, t.mapped, f.groups.keys);
    f.q = c.up({t.groups * t.l, wide}, q), f.k = c.up({t.groups * t.s, wide}, k), f.v = c.up({t.groups * t.s, wide}, v);
    f.out = c.gap(f.q.shape()), f.stats = c.gap({t.groups * t.l, t.heads});
    cross_attention_forward(c.ctx, f);
    c.close(
        "forward", f.out, [&] { return want.forward(); }, 1e-5);
    c.keep();  // statistics
    const Tensor dq = c.gap(f.q.shape()), dk = c.gap(f.k.shape()), dv = c.gap(f.v.shape());
    cross_attention_backward(c.ctx,
                             {f.q, f.k, f.v, t.heads, f.groups, f.out, f.stats, c.up(f.q.shape(), dout), dq, dk, dv});
    c.close(
        "backward, dq", dq, [&] { return want.gradient(&ref::CrossAttentionCase::q, dout); }, 2e-5);
    c.close(
        "backward, dk", dk, [&] { return want.gradient(&ref::CrossAttentionCase::k, dout); }, 2e-5);
    c.close(
        "backward, dv", dv, [&] { return want.gradient(&ref::CrossAttentionCase::v, dout); }, 2e-5);
  }
}

void rope_all(Checks& c) {
  for (const auto& [h, w, prefix, heads, d] :
       c.some({std::array<long, 5>{1, 1, 0, 1, 4}, {2, 3, 1, 2, 8}, {3, 5, 5, 3, 12}, {7, 9, 1, 2, 64}})) {
    const long v = 2, t = h * w + prefix;
    const auto qkv = random_floats(static_cast<std::size_t>(v * t * 3 * heads * d), 1);
    const auto at = [](long n) { return static_cast<std::size_t>(n); };
    const auto angles = ref::rope_angles(at(h), at(w), at(d), 100);
    const Tensor turns = c.up({h * w, d / 2, 2}, rope_turns(h, w, d, 100, false));
    const Tensor there = c.up({v, t, 3, heads, d}, qkv), back = c.up({v, t, 3, heads, d}, qkv);
    rope_forward(c.ctx, {there, turns});
    c.close("forward", there, ref::rope(qkv, at(v), at(t), at(heads), at(d), angles, 1), 1e-6);
    rope_backward(c.ctx, {back, turns});
    c.close("backward", back, ref::rope(qkv, at(v), at(t), at(heads), at(d), angles, -1), 1e-6);
  }
}

}  // namespace

std::vector<Case> attention_cases() {
  return {{"attention", attention_all}, {"cross_attention", cross_attention_all}, {"rope", rope_all}};
}

}  // namespace vsplat::selftest
