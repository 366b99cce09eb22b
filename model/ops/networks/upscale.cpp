#include "model/ops/networks/upscale.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

struct UpscaleSizes {
  long p, f, c, children, width;

  UpscaleSizes(Dims& d, const Tensor& raw, const Tensor& feature, const char* feature_name, long frequencies) {
    d.bind("raw", raw, {"P", "three F"}).bind(feature_name, feature, {"P", "C"});
    p = d["P"], f = d["three F"] / 3, c = d["C"], children = p * f, width = 6 * frequencies + c;
    if (3 * f != d["three F"] || frequencies < 0 || frequencies > 30)
      fail(Status::internal, "upscale: {} and {} frequencies", raw.describe(), frequencies);
    d.set("P F", children).set("W", width);
  }
};

}  // namespace

void upscale_forward(Context& ctx, const UpscaleForward& a) {
  Dims d;
  const UpscaleSizes s(d, a.raw, a.feature, "feature", a.frequencies);
  d.bind("points", a.points, {"P", "3"}).bind("children", a.children, {"P F", "3"});
  d.bind("offsets", a.offsets, {"P F", "3"}).bind("wide", a.wide, {"P F", "W"});
  const auto values = static_cast<double>(a.wide.count());
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, s.children) : groups(1, 32, s.children);
  ctx.launch({"upscale", "upscale_forward", ""}, range, {10 * values, 8 * values}, a.raw, a.points, a.feature,
             written(a.children), written(a.offsets), written(a.wide), s.p, s.f, a.frequencies, s.c,
             static_cast<float>(a.reach), static_cast<float>(a.unit));
}

void upscale_backward(Context& ctx, const UpscaleBackward& a) {
  Dims d;
  const UpscaleSizes s(d, a.raw, a.dfeature, "dfeature", a.frequencies);
  d.bind("dchildren", a.dchildren, {"P F", "3"}).bind("dwide", a.dwide, {"P F", "W"});
  d.bind("draw", a.draw, {"P", "three F"}).bind("dpoints", a.dpoints, {"P", "3"});
  const double waves = 6.0 * static_cast<double>(a.frequencies * s.children),
               features = static_cast<double>(s.children * s.c);
  ctx.launch({"upscale", "upscale_backward_points", ""}, items(s.p), {20 * waves, 4 * waves}, a.raw, a.dchildren,
             a.dwide, written(a.draw), written(a.dpoints), s.p, s.f, a.frequencies, s.c, static_cast<float>(a.reach),
             static_cast<float>(a.unit));
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, s.p) : groups(1, 32, s.p);
  ctx.launch({"upscale", "upscale_backward_features", ""}, range, {features, 8 * features}, a.dwide,
             written(a.dfeature), s.p, s.f, a.frequencies, s.c);
}

}  // namespace vsplat
