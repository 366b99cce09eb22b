#include "model/ops/fit/sparsity_loss.h"

#include "runtime/shape_check.h"

namespace vsplat {

void sparsity_loss(Context& ctx, const SparsityLoss& a) {
  Dims d;
  d.bind("opacities", a.opacities, {"K"}).bind("dopacities", a.dopacities, {"K"});
  const long k = d["K"];
  if (k == 0) return;
  ctx.launch({"sparsity_loss", "sparsity_loss", ""}, items(k),
             {3.0 * static_cast<double>(k), 3.0 * static_cast<double>(a.opacities.bytes())}, a.opacities,
             written(a.dopacities), k, a.weight / static_cast<float>(k));
}

}  // namespace vsplat
