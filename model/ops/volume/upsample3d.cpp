#include "model/ops/volume/upsample3d.h"

#include "runtime/shape_check.h"

namespace vsplat {

void upsample3d_forward(Context& ctx, const Upsample3dForward& a) {
  const long voxels = a.depth * a.height * a.width;
  Dims d;
  d.set("D*H*W", voxels)
      .set("output voxels", 8 * voxels)
      .bind("x", a.x, {"D*H*W", "C"})
      .bind("y", a.y, {"output voxels", "C"});
  const long c = d["C"];
  const double count = static_cast<double>(voxels) * static_cast<double>(c);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const Range range = cpu ? items(4 * a.depth * a.height, 1) : groups((c + 127) / 128, 32, 8 * voxels);
  if (voxels == 0 || c == 0) return;
  ctx.launch({"upsample3d", cpu ? "upsample3d_forward_cpu" : "upsample3d_forward_gpu", ""}, range,
             {8 * 14 * count, 4 * 9 * count}, a.x, written(a.y), a.depth, a.height, a.width, c);
}

void upsample3d_backward(Context& ctx, const Upsample3dBackward& a) {
  const long voxels = a.depth * a.height * a.width;
  Dims d;
  d.set("D*H*W", voxels)
      .set("output voxels", 8 * voxels)
      .bind("dx", a.dx, {"D*H*W", "C"})
      .bind("dy", a.dy, {"output voxels", "C"});
  const long c = d["C"];
  if (voxels == 0 || c == 0) return;
  const double count = static_cast<double>(voxels) * static_cast<double>(c);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const Range range = cpu ? items(a.depth * a.height, 1) : groups((c + 31) / 32, 32, voxels);
  ctx.launch({"upsample3d", cpu ? "upsample3d_backward_cpu" : "upsample3d_backward_gpu", ""}, range,
             {120 * count, 4 * 9 * count}, a.dy, written(a.dx), a.add ? 1 : 0, a.depth, a.height, a.width, c);
}

}  // namespace vsplat
