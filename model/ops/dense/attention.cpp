#include "model/ops/dense/attention.h"

#include <fmt/format.h>

#include <cmath>

#include "runtime/fail.h"
#include "runtime/gemm_pairs.h"
#include "runtime/rounding.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Sizes of a call, for both directions.
struct Sizes {
  long v, t, h, c;
  double product;  // FLOPs of one product of all queries with all keys

  Sizes(const Dims& d)
      : v(d["V"]), t(d["T"]), h(d["H"]), c(d["D"]), product(2.0 * static_cast<double>(v * h * c) * square(t)) {}
  static double square(long n) { return static_cast<double>(n) * static_cast<double>(n); }
  float scale() const { return static_cast<float>(1.0 / std::sqrt(static_cast<double>(c))); }
  // Queries or keys that a work-item of the cpu flavour owns. A tile of 12 rows is 24 vectors of 16: registers on a CPU
  // with vectors, minutes in a compiler that has none.
  long rows(const Context& ctx, const TunedValues& tuned) const {
    if (by_amx(ctx)) return 16;
    if (ctx.device().native_float_width < 4) return 2;
    return tuned.at("rows") > 0 ? tuned.at("rows") : 12;
  }
  bool pairs(const Context& ctx) const { return wants_pairs(ctx, c, t); }
  bool by_amx(const Context& ctx) const { return pairs(ctx) && multiplies_by_amx(ctx) && c % 32 == 0; }
  // Defines of the cpu flavour's kernels.
  std::string defines(const Context& ctx, const TunedValues& tuned) const {
    std::string out = fmt::format("-DHEAD_PAD={} -DROWS={}", round_up(c, 32L), rows(ctx, tuned));
    if (pairs(ctx)) out += " " + pair_defines(ctx);
    if (by_amx(ctx)) out += " -DMATRIX_AMX";
    if (tuned.at("panels") != default_values(*tuned.of).at("panels"))
      out += fmt::format(" -DPANELS={}", tuned.at("panels"));
    return out;
  }
  TunedShape tuned_shape(TunedOp op) const { return {op, {v * h, t, c}}; }
};

// The work-items of a group in the gpu flavour, which processes a quarter as many tokens: the most that the device
// allows.
struct GpuGroup {
  long items;
  std::string defines;
};

GpuGroup gpu_group(Context& ctx, const char* file, const char* kernel, long channels) {
  for (const long items : {256L, 128L, 64L}) {
    const std::string defines =
        fmt::format("-DHEAD_PAD={}{}", round_up(channels, 64L), items == 256 ? "" : fmt::format(" -DGROUP={}", items));
    const long rows = items / 4, local = 8192 + 32 * 4 * (rows + 4) + 16 * rows;  // see cl/dense/attention_tile_gpu.clh
    if (ctx.takes({file, kernel, defines}, static_cast<std::size_t>(items), static_cast<std::size_t>(local)))
      return {items, defines};
  }
  fail(Status::device, "{}: {} does not take it, not even in groups of 64", kernel, ctx.device().name);
}

void backward_cpu(Context& ctx, const AttentionBackward& a, const Sizes& s) {
  const long pad = round_up(s.c, 32L), panels = div_up(s.t, 32L), heads = s.v * s.h;
  const TunedValues tuned = ctx.tuned(s.tuned_shape(TunedOp::attention_backward));
  const long v = s.v, t = s.t, h = s.h, c = s.c, rows = s.rows(ctx, tuned);
  const bool pairs = s.pairs(ctx);
  const std::string defines = s.defines(ctx, tuned);
  const long share = pairs ? 2 : 1;  // numbers of a word
  const Type type = pairs ? Type::u32 : Type::f32;
  const Tensor across = ctx.tensor({4, heads, panels, div_up(s.c, share), 32}, type, "attention.across");
  const Tensor along = ctx.tensor({3, heads, panels * 32 / share, pad}, type, "attention.along");
  const Tensor terms = ctx.tensor({heads, panels, 3, 32}, Type::f32, "attention.terms");
  const double io = static_cast<double>(a.qkv.bytes()), tiles = static_cast<double>(across.bytes() + along.bytes());
  ctx.launch({"attention_backward_cpu", "attention_backward_pack", defines}, groups(panels, 1, heads, 4),
             {2.0 * static_cast<double>(a.out.count()), 5.0 / 3.0 * io + tiles}, a.qkv, a.out, a.stats, a.dout,
             written(across), written(along), written(terms), v, t, h, c, s.scale());
  const Range range = groups(div_up(s.t, rows), 1, heads);
  ctx.launch({"attention_backward_cpu", "attention_backward_by_query", defines}, range, {3 * s.product, tiles}, across,
             along, terms, written_somewhere(a.dqkv), v, t, h, c, s.scale());
  ctx.launch({"attention_backward_cpu", "attention_backward_by_key", defines}, range, {4 * s.product, tiles}, across,
             along, terms, written(a.dqkv), v, t, h, c);
}

void backward_gpu(Context& ctx, const AttentionBackward& a, const Sizes& s) {
  const long v = s.v, t = s.t, h = s.h, c = s.c;
  const std::string defines = fmt::format("-DHEAD_PAD={}", round_up(s.c, 64L));
  const Tensor delta = ctx.tensor({s.v, s.h, s.t}, Type::f32, "attention.delta");
  const double io = static_cast<double>(a.qkv.bytes() + a.dout.bytes());
  ctx.launch({"attention_backward_gpu", "attention_backward_delta", defines}, groups(div_up(s.t, 64L), 64, s.v * s.h),
             {2.0 * static_cast<double>(a.out.count()), 2.0 * static_cast<double>(a.out.bytes())}, a.out, a.dout,
             written(delta), v, t, h, c);
  for (const bool by_key : {false, true}) {
    const char* kernel = by_key ? "attention_backward_by_key" : "attention_backward_by_query";
    const GpuGroup group = gpu_group(ctx, "attention_backward_gpu", kernel, s.c);
    ctx.launch({"attention_backward_gpu", kernel, group.defines},
               groups(div_up(s.t, group.items / 4), group.items, s.v * s.h),
               {(by_key ? 4 : 3) * s.product, io + (by_key ? 2.0 : 1.0) * static_cast<double>(a.out.bytes())}, a.qkv,
               a.stats, delta, a.dout, by_key ? written(a.dqkv) : written_somewhere(a.dqkv), v, t, h, c, s.scale());
  }
}

}  // namespace

void attention_forward(Context& ctx, const AttentionForward& a) {
  Dims d;
  d.bind("qkv", a.qkv, {"V", "T", "3", "H", "D"});
  d.set("HD", d["H"] * d["D"]).bind("out", a.out, {"V", "T", "HD"});
  d.bind_optional("stats", a.stats, {"V", "H", "T", "2"});
  if (a.out.count() == 0) return;
  const Sizes s(d);
  const long v = s.v, t = s.t, h = s.h, c = s.c;
  const double io = static_cast<double>(a.qkv.bytes());
  const Cost cost{2 * s.product, io + static_cast<double>(a.out.bytes())};
  if (ctx.flavour() == Flavour::gpu) {
    const GpuGroup group = gpu_group(ctx, "attention_forward_gpu", "attention_forward_gpu", s.c);
    ctx.launch({"attention_forward_gpu", "attention_forward_gpu", group.defines},
               groups(div_up(s.t, group.items / 4), group.items, s.v * s.h), cost, a.qkv, written(a.out),
               written(a.stats), v, t, h, c, s.scale());
    return;
  }
  const TunedValues tuned = ctx.tuned(s.tuned_shape(TunedOp::attention_forward));
  const long pad = round_up(s.c, 32L), panels = div_up(s.t, 32L), rows = s.rows(ctx, tuned);
  const bool pairs = s.pairs(ctx);
  const std::string defines = s.defines(ctx, tuned);
  const long share = pairs ? 2 : 1;  // numbers of a word
  const Type type = pairs ? Type::u32 : Type::f32;
  const Tensor kt = ctx.tensor({s.v * s.h, panels, div_up(s.c, share), 32}, type, "attention.keys");
  const Tensor vp = ctx.tensor({s.v * s.h, panels * 32 / share, pad}, type, "attention.values");
  ctx.launch({"attention_forward_cpu", "attention_forward_pack", defines}, groups(panels, 1, s.v * s.h),
             {0, 4.0 / 3.0 * io}, a.qkv, written(kt), written(vp), v, t, h, c);
  ctx.launch({"attention_forward_cpu", "attention_forward_cpu", defines}, groups(div_up(s.t, rows), 1, s.v * s.h), cost,
             a.qkv, kt, vp, written(a.out), written(a.stats), v, t, h, c, s.scale());
}

void attention_backward(Context& ctx, const AttentionBackward& a) {
  Dims d;
  d.bind("qkv", a.qkv, {"V", "T", "3", "H", "D"}).bind("dqkv", a.dqkv, {"V", "T", "3", "H", "D"});
  d.set("HD", d["H"] * d["D"]).bind("out", a.out, {"V", "T", "HD"}).bind("dout", a.dout, {"V", "T", "HD"});
  d.bind("stats", a.stats, {"V", "H", "T", "2"});
  if (a.dqkv.count() == 0) return;
  if (ctx.flavour() == Flavour::cpu)
    backward_cpu(ctx, a, Sizes(d));
  else
    backward_gpu(ctx, a, Sizes(d));
}

}  // namespace vsplat
