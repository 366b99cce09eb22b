#include "model/ops/fit/surface_loss.h"

#include "runtime/shape_check.h"

namespace vsplat {

void surface_loss(Context& ctx, const SurfaceLoss& a) {
  Dims d;
  d.bind("normal", a.normal, {"H", "W", "3"}).bind("depth_normal", a.depth_normal, {"H", "W", "3"});
  d.bind("alpha", a.alpha, {"H", "W"}).bind("distortion", a.distortion, {"H", "W"});
  d.bind("dnormal", a.dnormal, {"H", "W", "3"}).bind("ddepth_normal", a.ddepth_normal, {"H", "W", "3"});
  d.bind("ddistortion", a.ddistortion, {"H", "W"}).bind("value", a.value, {"N"});
  const long pixels = d["H"] * d["W"];
  if (pixels == 0) return;
  constexpr long group = 64, each = 32;  // as cl/fit/surface_loss.cl
  const long blocks = (pixels + group * each - 1) / (group * each);
  const Tensor sums = ctx.tensor({blocks}, Type::f32, "surface_loss.sums");
  const double count = static_cast<double>(pixels);
  const float share = 1.0f / static_cast<float>(pixels);
  ctx.launch({"surface_loss", "surface_loss", ""}, groups(blocks, group), {22 * count, 60 * count}, a.normal,
             a.depth_normal, a.alpha, a.distortion, written(a.dnormal), written(a.ddepth_normal),
             written(a.ddistortion), written(sums), pixels, a.weights.distortion * share, a.weights.normal * share,
             a.gradient_scale);
  ctx.launch({"surface_loss", "surface_loss_value", ""}, items(1, 1), {}, sums, written(a.value, 1), blocks);
}

}  // namespace vsplat
