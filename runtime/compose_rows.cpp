#include "runtime/compose_rows.h"

#include "runtime/fail.h"
#include "runtime/rounding.h"

namespace vsplat {

void compose_rows(Context& ctx, const RowSource& in, const Tensor& out, long row0) {
  const auto matrix = [](const Tensor& x) { return x && x.rank() >= 2 && x.type() == Type::f32; };
  if (!matrix(in.x0) || !matrix(out) || (in.x1 && !matrix(in.x1)))
    fail(Status::internal, "compose_rows: {}, {} and {} found, f32 matrices expected", in.x0.describe(),
         in.x1.describe(), out.describe());
  const long c0 = in.x0.shape().back(), c1 = in.x1 ? in.x1.shape().back() : 0, taps = in.map ? in.map.dim(1) : 1;
  const long src_rows = in.x0.rows(), rows = out.rows(), all = in.map ? in.map.dim(0) : src_rows;
  if (out.shape().back() != taps * (c0 + c1) || row0 < 0 || row0 + rows > all || (in.x1 && in.x1.rows() != src_rows))
    fail(Status::internal, "compose_rows: rows [{}, {}) of {} x ({} and {}) do not give {}", row0, row0 + rows, taps,
         in.x0.describe(), in.x1.describe(), out.describe());
  for (const Tensor& t : {in.scale, in.shift})
    if (t && t.count() != c0 + c1)
      fail(Status::internal, "compose_rows: scale or shift is {}, [{}] expected", t.describe(), c0 + c1);
  const long chunks = div_up(c0, 16L) + div_up(c1, 16L);
  ctx.launch({"compose_rows", "compose_rows", ""}, items(rows * taps * chunks),
             {0, 8.0 * static_cast<double>(out.count())}, in.x0, c0, in.x1, c1, in.scale, in.shift, in.silu ? 1 : 0,
             in.map, taps, src_rows, row0, rows, written(out));
}

}  // namespace vsplat
