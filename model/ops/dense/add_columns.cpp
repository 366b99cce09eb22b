#include "model/ops/dense/add_columns.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {

void add_columns(Context& ctx, const AddColumns& a) {
  Dims d;
  d.bind("x", a.x, {"R", "X"}).bind("out", a.out, {"R", "W"});
  const long r = d["R"], x = d["X"], w = d["W"], c = a.count < 0 ? x - a.from : a.count;
  if (a.from < 0 || c < 0 || a.from + c > x)
    fail(Status::internal, "add_columns: columns {} to {} of {}", a.from, a.from + c, a.x.describe());
  if (a.column < 0 || a.column + c > w)
    fail(Status::internal, "add_columns: columns {} to {} of {}", a.column, a.column + c, a.out.describe());
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, r) : groups(1, 32, r);
  const double count = static_cast<double>(r * c);
  ctx.launch({"add_columns", "add_columns", ""}, range, {count, 12 * count}, a.x, written(a.out), r, c, x, a.from, w,
             a.column);
}

}  // namespace vsplat
