#include "runtime/column_sum.h"

#include "runtime/fail.h"
#include "runtime/rounding.h"

namespace vsplat {
namespace {

constexpr long kRows = 64;  // ROWS of cl/dense/column_sum.cl

}  // namespace

void column_sum(Context& ctx, const ColumnSum& a) {
  if (!a.x || a.x.rank() < 2 || a.x.type() != Type::f32 || !a.out || a.out.type() != Type::f32 ||
      a.out.count() != a.x.shape().back())
    fail(Status::internal, "column_sum: x is {}, out {}; f32 [.., C] and [C] expected", a.x.describe(),
         a.out.describe());
  const long columns = a.out.count();
  if (columns == 0) return;
  long rows = a.x.count() / columns;
  if (rows == 0) {
    if (!a.add) ctx.fill_zero(a.out);
    return;
  }
  for (Tensor from = a.x; rows > 0;) {
    const long sums = div_up(rows, kRows);
    const Tensor to = sums == 1 ? a.out : ctx.tensor({sums, columns}, Type::f32, "partial sums");
    const double read = static_cast<double>(rows) * static_cast<double>(columns);
    const bool cpu = ctx.flavour() == Flavour::cpu;
    ctx.launch({"column_sum", cpu ? "column_sum_cpu" : "column_sum", "", "column_sum"},
               cpu ? groups(sums, 1) : groups(div_up(columns, 64L), 64, sums),
               {read, 4 * (read + static_cast<double>(to.count()))}, from, written(to), rows, columns,
               sums == 1 && a.add ? 1 : 0);
    from = to;
    rows = sums == 1 ? 0 : sums;
  }
}

}  // namespace vsplat
