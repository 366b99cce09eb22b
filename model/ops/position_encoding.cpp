#include "model/ops/position_encoding.h"

#include "runtime/shape_check.h"

namespace vsplat {

void position_encoding_forward(Context& ctx, const PositionEncodingForward& a) {
  Dims d;
  d.bind("points", a.points, {"P", "3"}).bind("out", a.out, {"P", "W"});
  const long p = d["P"], w = d["W"];
  if (a.column < 0 || a.column + kPositionEncoding > w) {
    fail(Status::internal, "position encoding: columns {} to {} of {}", a.column, a.column + kPositionEncoding,
         a.out.describe());
  }
  const auto count = static_cast<double>(p);
  ctx.launch({"position_encoding", "position_encoding_fwd", ""}, items(p, 16), {60 * 20 * count, 4 * 66 * count},
             a.points, a.out, static_cast<int>(p), static_cast<int>(w), static_cast<int>(a.column));
}

}  // namespace vsplat
