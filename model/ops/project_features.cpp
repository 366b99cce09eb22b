#include "model/ops/project_features.h"

#include "runtime/shape_check.h"

namespace vsplat {

void project_features_forward(Context& ctx, const ProjectFeaturesForward& a) {
  Dims d;
  d.bind("features", a.features, {"V", "t", "t", "C"})
      .bind("points", a.points, {"P", "3"})
      .bind("out", a.out, {"P", "C"});
  d.bind("w2c", a.cameras->w2c, {"V", "4", "4"}).bind("c2w", a.cameras->c2w, {"V", "4", "4"});
  d.bind("intrinsics", a.cameras->intrinsics, {"V", "4"});
  const long p = d["P"], v = d["V"], c = d["C"];
  const double count = static_cast<double>(p) * static_cast<double>(c);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  ctx.launch({"project_features", cpu ? "project_features_cpu" : "project_features_gpu", ""},
             cpu ? items(p, 1) : groups(1, 64, p),
             {8 * count * static_cast<double>(v), 4 * count * static_cast<double>(4 * v + 1)}, a.features, a.points,
             a.cameras->w2c, a.cameras->c2w, a.cameras->intrinsics, a.out, static_cast<int>(p), static_cast<int>(v),
             static_cast<int>(d["t"]), static_cast<int>(c), static_cast<float>(a.image), a.half_pixel ? 0.5f : 0.0f,
             static_cast<int>(a.by_distance));
}

}  // namespace vsplat
