#include "model/ops/fit/depth_loss.h"

#include "runtime/column_sum.h"
#include "runtime/shape_check.h"

namespace vsplat {

void depth_loss(Context& ctx, const DepthLoss& a) {
  Dims d;
  d.bind("depth", a.drawn.depth, {"H", "W"}).bind("alpha", a.drawn.alpha, {"H", "W"});
  d.bind("given", a.given, {"H", "W"}).bind("ddepth", a.ddepth, {"H", "W"}).bind("dalpha", a.dalpha, {"H", "W"});
  const long h = d["H"], w = d["W"], pixels = h * w;
  const auto count = static_cast<double>(pixels);
  Tensor sums;
  const int inverse = a.kind == DepthKind::inverse ? 1 : 0;
  if (a.kind != DepthKind::metric) {
    const Tensor rows = ctx.tensor({h, 5}, Type::f32, "sums of depths");
    ctx.launch({"depth_loss", "depth_loss_sums", ""}, items(h), {12 * count, 12 * count}, a.drawn.depth, a.drawn.alpha,
               a.given, written(rows), h, w, inverse);
    sums = ctx.tensor({5}, Type::f32, "sums of depths");
    column_sum(ctx, {rows, sums});
  }
  ctx.launch({"depth_loss", "depth_loss", ""}, items(pixels), {16 * count, 24 * count}, a.drawn.depth, a.drawn.alpha,
             a.given, sums, written(a.ddepth), written(a.dalpha), pixels, inverse,
             a.known > 0 ? static_cast<float>(a.weight / a.known) : 0.0f);
}

}  // namespace vsplat
