#include "model/ops/networks/ray_loss.h"

#include "runtime/column_sum.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {

void ray_loss(Context& ctx, const RayLoss& a) {
  Dims d;
  d.bind("predicted", a.predicted, {"R", "6"}).bind("target", a.target, {"R", "6"}).bind("out", a.out, {"1"});
  d.bind_optional("dpredicted", a.dpredicted, {"R", "6"});
  const long rays = d["R"];
  if (rays == 0) fail(Status::internal, "ray_loss: no rays");
  const Tensor errors = ctx.tensor({rays, 1}, Type::f32, "ray_loss.errors");
  ctx.launch({"ray_loss", "ray_loss", ""}, items(rays),
             {24.0 * static_cast<double>(rays), 3.0 * static_cast<double>(a.predicted.bytes())}, a.predicted, a.target,
             written(errors), written(a.dpredicted), rays, a.gradient_scale);
  column_sum(ctx, {errors, a.out, false});
}

}  // namespace vsplat
