#include "model/ops/networks/project_features.h"

#include "model/ops/dense/scatter_rows.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

Dims bind_inputs(const ProjectFeaturesForward& a) {
  Dims d;
  d.bind("features", a.features, {"V", "t", "t", "C"}).bind("points", a.points, {"P", "3"});
  d.bind("w2c", a.cameras->w2c, {"V", "4", "4"}).bind("c2w", a.cameras->c2w, {"V", "4", "4"});
  d.bind("intrinsics", a.cameras->intrinsics, {"V", "4"});
  return d;
}

float half_of(const ProjectFeaturesForward& a) { return a.half_pixel ? 0.5f : 0.0f; }

}  // namespace

void project_features_forward(Context& ctx, const ProjectFeaturesForward& a) {
  Dims d = bind_inputs(a);
  d.bind("out", a.out, {"P", "C"});
  const long p = d["P"], v = d["V"], c = d["C"];
  const double count = static_cast<double>(p) * static_cast<double>(c);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  ctx.launch({"project_features", cpu ? "project_features_forward_cpu" : "project_features_forward_gpu", ""},
             cpu ? items(p, 1) : groups(1, 64, p),
             {8 * count * static_cast<double>(v), 4 * count * static_cast<double>(4 * v + 1)}, a.features, a.points,
             a.cameras->w2c, a.cameras->c2w, a.cameras->intrinsics, written(a.out), p, v, d["t"], c,
             static_cast<float>(a.image), half_of(a), static_cast<int>(a.by_distance));
}

void project_features_backward(Context& ctx, const ProjectFeaturesBackward& a) {
  const ProjectFeaturesForward& f = a.forward;
  Dims d = bind_inputs(f);
  d.bind("dout", a.dout, {"P", "C"}).bind("dpoints", a.dpoints, {"P", "3"});
  d.bind("dfeatures", a.dfeatures, {"V", "t", "t", "C"});
  const long p = d["P"], v = d["V"], c = d["C"];
  if (p * v * c == 0) return;
  const long t = d["t"];
  const double pairs = static_cast<double>(p * v), terms = pairs * static_cast<double>(c);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const Tensor dots = ctx.tensor({p, v, 4}, Type::f32, "dots with the texels");
  ctx.launch(
      {"project_features", cpu ? "project_features_backward_dots_cpu" : "project_features_backward_dots_gpu", ""},
      cpu ? items(p * v, 1) : groups(p * v, 64), {8 * terms, 20 * terms}, f.features, f.points, f.cameras->w2c,
      f.cameras->intrinsics, a.dout, written(dots), p, v, t, c, static_cast<float>(f.image), half_of(f));
  ctx.launch({"project_features", "project_features_backward_points", ""}, items(p, cpu ? 1 : 64),
             {200 * pairs, 16 * pairs}, f.points, f.cameras->w2c, f.cameras->c2w, f.cameras->intrinsics, dots,
             written(a.dpoints), p, v, t, static_cast<float>(f.image), half_of(f), static_cast<int>(f.by_distance));

  const Tensor index = ctx.tensor({p, v, 4}, Type::i32, "texels"),
               weight = ctx.tensor({p, v, 4}, Type::f32, "texels' shares");
  ctx.launch({"project_features", "project_features_backward_texels", ""}, items(p, cpu ? 1 : 64),
             {100 * pairs, 32 * pairs}, f.points, f.cameras->w2c, f.cameras->c2w, f.cameras->intrinsics, written(index),
             written(weight), p, v, t, static_cast<float>(f.image), half_of(f), static_cast<int>(f.by_distance));
  const ScatterPlan plan = make_scatter_plan(ctx, index, weight, v * t * t);
  scatter_rows(ctx, {&plan, a.dout, 0, 4 * v, 1, a.dfeatures.reshaped({v * t * t, c})});
}

}  // namespace vsplat
