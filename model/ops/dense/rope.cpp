#include "model/ops/dense/rope.h"

#include <cmath>

#include "model/base/rope_periods.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

void launch(Context& ctx, const char* kernel, const Tensor& qkv, const Tensor& turns) {
  Dims d;
  d.bind("qkv", qkv, {"V", "T", "3", "H", "D"});
  d.set("D/2", d["D"] / 2).bind("turns", turns, {"N", "D/2", "2"});
  const long v = d["V"], t = d["T"], h = d["H"], c = d["D"], n = d["N"], p = t - n;
  if (c % 2 != 0 || p < 0) fail(Status::internal, "rope: heads of {}, {} of {} tokens to turn", c, n, t);
  if (v * n * h * c == 0) return;
  const double turned = 2.0 * static_cast<double>(v * n * h * c);
  ctx.launch({"rope", kernel, ""}, groups((h * c / 2 + 63) / 64, 64, n, v), {3 * turned, 8 * turned}, written(qkv),
             turns, v, t, h, c, p);
}

}  // namespace

std::vector<float> rope_turns(long h, long w, long head, double base, bool bf16) {
  if (head % 4 != 0) fail(Status::internal, "rope: heads of {} channels, a multiple of 4 is expected", head);
  const std::vector<double> periods = rope_periods(head, base, bf16);
  const double full = 2 * std::acos(-1.0);
  const auto centre = [](long i, long n) { return 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 1; };
  std::vector<float> out;
  for (long row = 0; row < h; ++row)
    for (long column = 0; column < w; ++column)
      for (const double at : {centre(row, h), centre(column, w)})
        for (const double period : periods) {
          const double angle = full * at / period;
          out.push_back(static_cast<float>(std::cos(angle)));
          out.push_back(static_cast<float>(std::sin(angle)));
        }
  return out;
}

void rope_forward(Context& ctx, const RopeForward& a) { launch(ctx, "rope_forward", a.qkv, a.turns); }
void rope_backward(Context& ctx, const RopeBackward& a) { launch(ctx, "rope_backward", a.dqkv, a.turns); }

}  // namespace vsplat
