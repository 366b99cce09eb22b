#include "model/ops/dense/cross_attention.h"

#include <fmt/format.h>

#include <cmath>

#include "runtime/fail.h"
#include "runtime/rounding.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Sizes of a call, for both directions.
struct Sizes {
  long g, l, s, h, d;
  long b = 1;  // groups that a key is in
  std::string defines;
  double pairs;  // multiplications of one product of all queries with their keys
  double bytes;  // of q, k and v, each read once

  Sizes(const Tensor& q, const Tensor& k, const Tensor& v, long heads, const AttentionGroups& groups) {
    Dims dims;
    dims.bind("q", q, {"Q", "HD"}).bind("k", k, {"N", "HD"}).bind("v", v, {"N", "HD"});
    dims.bind_optional("queries", groups.queries, {"G", "L"}, Type::i32);
    dims.bind_optional("keys", groups.keys, {"G", "S"}, Type::i32);
    l = groups.queries ? dims["L"] : groups.l;
    s = groups.keys ? dims["S"] : groups.s;
    h = heads;
    if (h < 1 || dims["HD"] % h != 0) fail(Status::internal, "attention: {} channels in {} heads", dims["HD"], h);
    if (l < 1 || s < 1) fail(Status::internal, "attention: {} queries and {} keys a group", l, s);
    d = dims["HD"] / h;
    g = dims["Q"] / l;
    dims.bind_optional("places", groups.places, {"N", "B"}, Type::i32);
    if (groups.places) b = dims["B"];
    if (b < 1 || g * l != dims["Q"] || g * s != dims["N"] * b)
      fail(Status::internal, "attention: {} queries and {} times {} keys are not groups of {} and {}", dims["Q"], b,
           dims["N"], l, s);
    if (groups.places && !groups.keys) fail(Status::internal, "attention: keys of several groups without a map");
    if (static_cast<bool>(groups.query_parts) != static_cast<bool>(groups.key_parts))
      fail(Status::internal, "attention: parts of queries or of keys alone");
    dims.set("G", g).set("L", l).set("S", s);
    dims.bind_optional("query_parts", groups.query_parts, {"G", "L"}, Type::i32);
    dims.bind_optional("key_parts", groups.key_parts, {"G", "S"}, Type::i32);
    defines = fmt::format("-DHEAD_PAD={}", round_up(d, 16L));
    pairs = 2.0 * static_cast<double>(g * l) * static_cast<double>(s) * static_cast<double>(h * d);
    bytes = static_cast<double>(q.bytes() + k.bytes() + v.bytes());
  }
  float scale() const { return static_cast<float>(1.0 / std::sqrt(static_cast<double>(d))); }
};

}  // namespace

void cross_attention_forward(Context& ctx, const CrossAttentionForward& a) {
  const Sizes z(a.q, a.k, a.v, a.heads, a.groups);
  Dims().like("out", a.out, "q", a.q).set("Q", z.g * z.l).set("H", z.h).bind_optional("stats", a.stats, {"Q", "H"});
  if (a.q.count() == 0) return;
  ctx.launch({"cross_attention", "cross_attention_forward", z.defines}, items(z.g * z.l * z.h),
             {2 * z.pairs, z.bytes + static_cast<double>(a.out.bytes())}, a.q, a.k, a.v, a.groups.queries,
             a.groups.keys, a.groups.query_parts, a.groups.key_parts, written(a.out), written(a.stats), z.g, z.l, z.s,
             z.h, z.d, z.scale());
}

void cross_attention_backward(Context& ctx, const CrossAttentionBackward& a) {
  const Sizes z(a.q, a.k, a.v, a.heads, a.groups);
  Dims d;
  d.like("out", a.out, "q", a.q).like("dout", a.dout, "q", a.q).like("dq", a.dq, "q", a.q);
  d.like("dk", a.dk, "k", a.k).like("dv", a.dv, "k", a.k);
  d.set("Q", z.g * z.l).set("H", z.h).bind("stats", a.stats, {"Q", "H"});
  if (a.q.count() == 0) return;
  const Tensor delta = ctx.tensor({z.g * z.l, z.h}, Type::f32, "cross_attention.delta");
  const double rows = static_cast<double>(a.q.bytes());
  ctx.launch({"cross_attention", "cross_attention_backward_by_query", z.defines}, items(z.g * z.l * z.h),
             {3 * z.pairs, z.bytes + 3 * rows}, a.q, a.k, a.v, a.groups.queries, a.groups.keys, a.groups.query_parts,
             a.groups.key_parts, a.out, a.stats, a.dout, written(a.dq), written(delta), z.g, z.l, z.s, z.h, z.d,
             z.scale());
  ctx.launch({"cross_attention", "cross_attention_backward_by_key", z.defines}, items(z.g * z.s / z.b * z.h),
             {4 * z.pairs, 2 * z.bytes}, a.q, a.k, a.v, a.groups.queries, a.groups.keys, a.groups.query_parts,
             a.groups.key_parts, a.groups.places, a.stats, delta, a.dout, written(a.dk), written(a.dv), z.g, z.l, z.s,
             z.h, z.d, z.b, z.scale());
}

}  // namespace vsplat
