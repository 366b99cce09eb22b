#include "model/ops/networks/plucker.h"

#include "runtime/shape_check.h"

namespace vsplat {

void plucker_forward(Context& ctx, const PluckerForward& a) {
  Dims d;
  d.bind("c2w", a.cameras.c2w, {"V", "4", "4"}).bind("intrinsics", a.cameras.intrinsics, {"V", "4"});
  d.bind("out", a.out, {"V", "t", "t", "32"});
  const long patches = d["V"] * d["t"] * d["t"];
  ctx.launch({"plucker", "plucker", ""}, items(patches),
             {120.0 * static_cast<double>(patches), static_cast<double>(a.out.bytes())}, a.cameras.c2w,
             a.cameras.intrinsics, written(a.out), d["V"], d["t"], static_cast<float>(a.patch));
}

}  // namespace vsplat
