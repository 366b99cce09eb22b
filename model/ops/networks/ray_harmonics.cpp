#include "model/ops/networks/ray_harmonics.h"

#include "runtime/shape_check.h"

namespace vsplat {

void ray_harmonics_forward(Context& ctx, const RayHarmonicsForward& a) {
  Dims d;
  d.bind("rays", a.rays, {"R", "6"}).bind("out", a.out, {"R", "32"});
  const long rays = d["R"];
  if (rays == 0) return;
  ctx.launch({"ray_harmonics", "ray_harmonics_forward", ""}, items(2 * rays),
             {100.0 * static_cast<double>(rays), static_cast<double>(a.rays.bytes() + a.out.bytes())}, a.rays,
             written(a.out), rays);
}

void ray_harmonics_backward(Context& ctx, const RayHarmonicsBackward& a) {
  Dims d;
  d.bind("rays", a.rays, {"R", "6"}).bind("dout", a.dout, {"R", "32"}).bind("drays", a.drays, {"R", "6"});
  const long rays = d["R"];
  if (rays == 0) return;
  ctx.launch({"ray_harmonics", "ray_harmonics_backward", ""}, items(2 * rays),
             {160.0 * static_cast<double>(rays), static_cast<double>(2 * a.rays.bytes() + a.dout.bytes())}, a.rays,
             a.dout, written(a.drays), rays);
}

}  // namespace vsplat
