#include "model/ops/add_columns.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {

void add_columns(Context& ctx, const AddColumns& a) {
  Dims d;
  d.bind("x", a.x, {"R", "C"}).bind("out", a.out, {"R", "W"});
  const long r = d["R"], c = d["C"], w = d["W"];
  if (a.column < 0 || a.column + c > w)
    fail(Status::internal, "add_columns: columns {} to {} of {}", a.column, a.column + c, a.out.describe());
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, r) : groups(1, 32, r);
  const double count = static_cast<double>(a.x.count());
  ctx.launch({"add_columns", "add_columns", ""}, range, {count, 12 * count}, a.x, written(a.out), r, c, w, a.column);
}

}  // namespace vsplat
