#include "model/ops/dense/transpose.h"

#include "runtime/gemm.h"
#include "runtime/rounding.h"
#include "runtime/shape_check.h"

namespace vsplat {

void transpose(Context& ctx, const Transpose& a) {
  Dims d;
  d.bind("x", a.x, {"A", "B"}).bind("out", a.out, {"B", "A"});
  if (a.x.count() == 0) return;
  const long tile = square_side(ctx);
  ctx.launch({"transpose", "transpose", tile == 16 ? "" : "-DTILE=8"},
             groups(div_up(d["B"], tile), tile * tile, div_up(d["A"], tile)),
             {0, (a.add ? 12.0 : 8.0) * static_cast<double>(a.x.count())}, a.x, written(a.out), d["A"], d["B"],
             static_cast<long>(a.add));
}

}  // namespace vsplat
