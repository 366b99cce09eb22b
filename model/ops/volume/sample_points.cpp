#include "model/ops/volume/sample_points.h"

#include "model/ops/dense/scatter_rows.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

Dims bound(const SamplePointsForward& a) {
  Dims d;
  d.bind("maps", a.maps, {"V", "S", "S", "8"}).bind("points", a.points, {"P", "3"});
  d.bind("w2c", a.cameras->w2c, {"V", "4", "4"}).bind("intrinsics", a.cameras->intrinsics, {"V", "4"});
  return d;
}

Cost cost_of(const Dims& d, double numbers) {
  const double samples = static_cast<double>(d["P"] * d["V"]);
  return {100 * samples, 4 * numbers * samples};
}

}  // namespace

void sample_points_forward(Context& ctx, const SamplePointsForward& a) {
  Dims d = bound(a);
  d.bind("out", a.out, {"P", "V", "8"});
  ctx.launch({"sample_points", "sample_points_forward", ""}, items(d["P"] * d["V"]), cost_of(d, 40), a.maps, a.points,
             a.cameras->w2c, a.cameras->intrinsics, written(a.out), d["P"], d["V"], d["S"], a.half_pixel ? 0.5f : 0.0f);
}

void sample_points_backward(Context& ctx, const SamplePointsBackward& b) {
  const SamplePointsForward& a = b.forward;
  Dims d = bound(a);
  d.bind("dout", b.dout, {"P", "V", "8"}).bind("dpoints", b.dpoints, {"P", "3"});
  d.bind_optional("dmaps", b.dmaps, {"V", "S", "S", "8"});
  const long p = d["P"], v = d["V"], s = d["S"];
  const float half = a.half_pixel ? 0.5f : 0.0f;
  ctx.launch({"sample_points", "sample_points_backward_points", ""}, items(p), cost_of(d, 40), a.maps, a.points,
             a.cameras->w2c, a.cameras->intrinsics, b.dout, written(b.dpoints), p, v, s, half);
  if (!b.dmaps || p == 0) return;
  const Tensor index = ctx.tensor({p, v, 4}, Type::i32, "sample_points.index");
  const Tensor weight = ctx.tensor({p, v, 4}, Type::f32, "sample_points.weight");
  const Tensor dsamples = ctx.tensor({p * v, 8}, Type::f32, "sample_points.dsamples");
  ctx.launch({"sample_points", "sample_points_backward_maps", ""}, items(p * v), cost_of(d, 56), a.maps, a.points,
             a.cameras->w2c, a.cameras->intrinsics, b.dout, written(index), written(weight), written(dsamples), p, v, s,
             half);
  const ScatterPlan plan = make_scatter_plan(ctx, index, weight, v * s * s);
  scatter_rows(ctx, {&plan, dsamples, 0, 4, 1, b.dmaps.reshaped({v * s * s, 8})});
}

}  // namespace vsplat
