#include "model/ops/transpose.h"

#include "runtime/rounding.h"
#include "runtime/shape_check.h"

namespace vsplat {

void transpose(Context& ctx, const Transpose& a) {
  constexpr long kTile = 16;  // TILE of cl/transpose.cl
  Dims d;
  d.bind("x", a.x, {"A", "B"}).bind("out", a.out, {"B", "A"});
  if (a.x.count() == 0) return;
  Range range = groups(div_up(d["B"], kTile), kTile, div_up(d["A"], kTile));
  range.global[1] *= kTile;
  range.local[1] = kTile;
  ctx.launch({"transpose", "transpose", ""}, range, {0, (a.add ? 12.0 : 8.0) * static_cast<double>(a.x.count())}, a.x,
             written(a.out), d["A"], d["B"], static_cast<long>(a.add));
}

}  // namespace vsplat
