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
                              {65, 2, 4, 2, 4, true}},
                             {{1, 2, 6, 5, 4, true}, {211, 8, 4, 4, 4, true}})) {
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
        "forward", f.out, [&] { return want.forward(); }, c.within(1e-5, 1e-6));
    c.keep();  // statistics
    const Tensor dq = c.gap(f.q.shape()), dk = c.gap(f.k.shape()), dv = c.gap(f.v.shape());
    cross_attention_backward(c.ctx,
                             {f.q, f.k, f.v, t.heads, f.groups, f.out, f.stats, c.up(f.q.shape(), dout), dq, dk, dv});
    c.close(
        "backward, dq", dq, [&] { return want.gradient(&ref::CrossAttentionCase::q, dout); }, c.within(2e-5, 1e-5));
    c.close(
        "backward, dk", dk, [&] { return want.gradient(&ref::CrossAttentionCase::k, dout); }, c.within(2e-5, 1e-5));
    c.close(
        "backward, dv", dv, [&] { return want.gradient(&ref::CrossAttentionCase::v, dout); }, c.within(2e-5, 1e-5));
  }
}

}  // namespace

VSPLAT_CASES(cross_attention, {"cross_attention", cross_attention_all})

}  // namespace vsplat::selftest
