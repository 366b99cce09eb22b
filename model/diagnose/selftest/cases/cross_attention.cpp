#include "model/diagnose/selftest/reference/cross_attention.h"

#include <algorithm>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/cross_attention.h"

namespace vsplat::selftest {
namespace {

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

struct CrossAttentionTry {
  long groups, l, s, heads, width;
  bool mapped;
  long shared = 0;   // > 0: each key is in so many groups, at a different position each time, and some are masked
  float spread = 1;  // of scores; above 1 the forward alone
};

// As in the ray predictor's windows.
void share_keys(Checks& c, const CrossAttentionTry& t, ref::CrossAttentionCase& want, AttentionGroups& groups) {
  std::vector<int> rows(size_of(t.groups, t.s)), places(rows.size()), query_parts, key_parts;
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int>(i / size_of(t.shared));
  std::shuffle(rows.begin(), rows.end(), std::mt19937(3));
  std::vector<std::size_t> found(rows.size() / size_of(t.shared), 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto key = static_cast<std::size_t>(rows[i]);
    places[key * size_of(t.shared) + found[key]++] = static_cast<int>(i);
  }
  for (long i = 0; i < t.groups * t.l; ++i) query_parts.push_back(static_cast<int>(i % 3));
  for (long i = 0; i < t.groups * t.s; ++i) key_parts.push_back(static_cast<int>(i * 7 % 3));
  groups.keys = c.up({t.groups, t.s}, rows), groups.places = c.up({t.groups * t.s / t.shared, t.shared}, places);
  groups.query_parts = c.up({t.groups, t.l}, query_parts), groups.key_parts = c.up({t.groups, t.s}, key_parts);
  want.keys.clear();
  for (long g = 0; g < t.groups; ++g) {
    want.keys.emplace_back(rows.begin() + g * t.s, rows.begin() + (g + 1) * t.s);
    want.query_parts.emplace_back(query_parts.begin() + g * t.l, query_parts.begin() + (g + 1) * t.l);
    want.key_parts.emplace_back(key_parts.begin() + g * t.s, key_parts.begin() + (g + 1) * t.s);
  }
}

void cross_attention_of(Checks& c, const CrossAttentionTry& t) {
  const long wide = t.heads * t.width, keys = t.groups * t.s / std::max(t.shared, 1L);
  const auto q = random_floats(size_of(t.groups * t.l, wide), 1, -t.spread, t.spread),
             k = random_floats(size_of(keys, wide), 2, -t.spread, t.spread), v = random_floats(k.size(), 3),
             dout = random_floats(q.size(), 4);
  ref::CrossAttentionCase want{
      size_of(t.heads), size_of(t.width), as_doubles(q), as_doubles(k), as_doubles(v), {}, {}, {}, {}};
  CrossAttentionForward f;
  f.heads = t.heads, f.groups.l = t.l, f.groups.s = t.s;
  want.queries = groups_of(c, t.groups, t.l, t.mapped, f.groups.queries);
  want.keys = groups_of(c, t.groups, t.s, t.mapped, f.groups.keys);
  if (t.shared > 0) share_keys(c, t, want, f.groups);
  f.q = c.up({t.groups * t.l, wide}, q), f.k = c.up({keys, wide}, k), f.v = c.up({keys, wide}, v);
  f.out = c.gap(f.q.shape()), f.stats = c.gap({t.groups * t.l, t.heads});
  cross_attention_forward(c.ctx, f);
  c.close(
      "forward", f.out, [&] { return want.forward(); }, t.spread > 1 ? 1e-4 : c.within(1e-5, 1e-6));
  if (c.all) {
    CrossAttentionForward alone = f;
    alone.stats = {}, alone.out = c.gap(f.q.shape());
    cross_attention_forward(c.ctx, alone);
    c.equal("forward, without statistics", alone.out, c.ctx.read<float>(f.out));
  }
  if (t.spread > 1) return;
  c.keep();  // statistics
  const Tensor dq = c.gap(f.q.shape()), dk = c.gap(f.k.shape()), dv = c.gap(f.v.shape());
  cross_attention_backward(c.ctx,
                           {f.q, f.k, f.v, t.heads, f.groups, f.out, f.stats, c.up(f.q.shape(), dout), dq, dk, dv});
  // (A softmax of one key, whose weight is 1 whatever it is, has no gradient by queries and keys.)
  const auto by = [&](std::vector<double> ref::CrossAttentionCase::*of, bool softmax) {
    return softmax && t.s == 1 ? std::vector<double>((want.*of).size()) : want.gradient(of, dout);
  };
  const double tolerance = c.within(2e-5, 1e-5);
  c.close(
      "backward, dq", dq, [&] { return by(&ref::CrossAttentionCase::q, true); }, tolerance);
  c.close(
      "backward, dk", dk, [&] { return by(&ref::CrossAttentionCase::k, true); }, tolerance);
  c.close(
      "backward, dv", dv, [&] { return by(&ref::CrossAttentionCase::v, false); }, tolerance);
}

void cross_attention_all(Checks& c) {
  for (const CrossAttentionTry& t : c.some({CrossAttentionTry{1, 1, 2, 1, 1, false},
                                            {3, 1, 4, 2, 5, false},
                                            {2, 7, 3, 3, 16, true},
                                            {3, 8, 4, 2, 15, true},
                                            {2, 3, 13, 1, 33, false},
                                            {65, 2, 4, 2, 4, true}},
                                           {{1, 2, 6, 5, 4, true},
                                            {211, 8, 4, 4, 4, true},
                                            {1, 1, 1, 1, 1, false},
                                            {5, 2, 1, 1, 17, true},
                                            {2, 3, 5, 1, 16, true, 2},
                                            {3, 2, 4, 1, 3, true, 2},
                                            {4, 7, 6, 1, 17, true, 3},
                                            {5, 1, 4, 1, 8, true, 4},
                                            {40, 3, 5, 2, 6, false, 0, 20}}))
    cross_attention_of(c, t);
}

}  // namespace

VSPLAT_CASES(cross_attention, {"cross_attention", cross_attention_all})

}  // namespace vsplat::selftest
