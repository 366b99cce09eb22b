#include "model/ops/attention.h"

#include <cmath>

#include "runtime/shape_check.h"

namespace vsplat {
namespace {

long round_up(long value, long step) { return (value + step - 1) / step * step; }

}  // namespace

void attention_forward(Context& ctx, const AttentionForward& a) {
  Dims d;
  d.bind("qkv", a.qkv, {"V", "T", "3", "H", "D"});
  const long v = d["V"], t = d["T"], h = d["H"], c = d["D"];
  d.set("HD", h * c).bind("out", a.out, {"V", "T", "HD"});
  if (a.out.count() == 0) return;
  const int vi = static_cast<int>(v), ti = static_cast<int>(t), hi = static_cast<int>(h), ci = static_cast<int>(c);
  const float scale = static_cast<float>(1.0 / std::sqrt(static_cast<double>(c)));
  const double io = static_cast<double>(a.qkv.bytes());
  const double pairs = static_cast<double>(v * h) * static_cast<double>(t) * static_cast<double>(t);
  const Cost cost{4.0 * pairs * static_cast<double>(c), io + static_cast<double>(a.out.bytes())};
  if (ctx.flavour() == Flavour::gpu) {
    const std::string defines = fmt::format("-DHEAD_PAD={}", round_up(c, 64));
    ctx.launch({"attention_gpu", "attention_gpu", defines}, groups((t + 63) / 64, 256, v * h), cost, a.qkv, a.out, vi,
               ti, hi, ci, scale);
    return;
  }
  // A tile of 12 rows is 24 vectors of 16: registers on a CPU with vectors, minutes in a compiler that has none.
  const long pad = round_up(c, 32), panels = (t + 31) / 32, rows = ctx.device().native_float_width >= 4 ? 12 : 2;
  const std::string defines = fmt::format("-DHEAD_PAD={} -DROWS={}", pad, rows);
  const Tensor kt = ctx.tensor({v * h, panels, c, 32}, Type::f32, "attention.keys");
  const Tensor vp = ctx.tensor({v * h, panels * 32, pad}, Type::f32, "attention.values");
  ctx.launch({"attention_cpu", "attention_pack", defines}, groups(panels, 1, v * h), {0, 4.0 / 3.0 * io}, a.qkv, kt, vp,
             vi, ti, hi, ci);
  ctx.launch({"attention_cpu", "attention_cpu", defines}, groups((t + rows - 1) / rows, 1, v * h), cost, a.qkv, kt, vp,
             a.out, vi, ti, hi, ci, scale);
}

}  // namespace vsplat
