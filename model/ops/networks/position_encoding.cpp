#include "model/ops/networks/position_encoding.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

void check_columns(const char* op, long column, const Tensor& encoded) {
  if (column < 0 || column + kPositionEncoding > encoded.dim(1))
    fail(Status::internal, "{}: columns {} to {} of {}", op, column, column + kPositionEncoding, encoded.describe());
}

}  // namespace

void position_encoding_forward(Context& ctx, const PositionEncodingForward& a) {
  Dims d;
  d.bind("points", a.points, {"P", "3"}).bind("out", a.out, {"P", "W"});
  check_columns("position encoding", a.column, a.out);
  const auto count = static_cast<double>(d["P"]);
  ctx.launch({"position_encoding", "position_encoding_forward", ""}, items(d["P"], 16),
             {60 * 20 * count, 4 * 66 * count}, a.points,
             d["W"] == kPositionEncoding ? written(a.out) : written_somewhere(a.out), d["P"], d["W"], a.column);
}

void position_encoding_backward(Context& ctx, const PositionEncodingBackward& a) {
  Dims d;
  d.bind("points", a.points, {"P", "3"}).bind("dout", a.dout, {"P", "W"}).bind("dpoints", a.dpoints, {"P", "3"});
  check_columns("position encoding, backward", a.column, a.dout);
  const auto count = static_cast<double>(d["P"]);
  ctx.launch({"position_encoding", "position_encoding_backward", ""}, items(d["P"], 16),
             {60 * 22 * count, 4 * 72 * count}, a.points, a.dout, written(a.dpoints), d["P"], d["W"], a.column);
}

}  // namespace vsplat
