#include "model/ops/fit/splat_filter.h"

#include "runtime/shape_check.h"

namespace vsplat {

void splat_filter_variances(Context& ctx, const SplatFilterVariances& a) {
  Dims d;
  d.bind("means", a.means, {"K", "3"}).bind("views", a.views, {"V", "32"}).bind("variances", a.variances, {"K"});
  const auto count = static_cast<double>(d["K"]), views = static_cast<double>(d["V"]);
  ctx.launch({"splat_filter", "splat_filter_variances", ""}, items(d["K"]), {30 * count * views, 16 * count}, a.means,
             a.views, written(a.variances), d["K"], d["V"]);
}

void splat_filter_forward(Context& ctx, const SplatFilterForward& a) {
  Dims d;
  d.bind("variances", a.variances, {"K"}).bind("scales", a.scales, {"K", "3"}).bind("opacities", a.opacities, {"K"});
  const auto count = static_cast<double>(d["K"]);
  ctx.launch({"splat_filter", "splat_filter_forward", ""}, items(d["K"]), {15 * count, 36 * count}, a.variances,
             written(a.scales), written(a.opacities), d["K"]);
}

void splat_filter_backward(Context& ctx, const SplatFilterBackward& a) {
  Dims d;
  d.bind("variances", a.variances, {"K"}).bind("log_scales", a.log_scales, {"K", "3"});
  d.bind("opacities", a.opacities, {"K"}).bind("dscales", a.dscales, {"K", "3"});
  d.bind("dopacities", a.dopacities, {"K"});
  const auto count = static_cast<double>(d["K"]);
  ctx.launch({"splat_filter", "splat_filter_backward", ""}, items(d["K"]), {50 * count, 52 * count}, a.variances,
             a.log_scales, a.opacities, written(a.dscales), written(a.dopacities), d["K"]);
}

}  // namespace vsplat
