#include "model/ops/dense/gather.h"

#include <algorithm>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// [K, ..] as [K, C]; none as it is.
Tensor rows_of(const Tensor& x) {
  if (!x) return x;
  long c = 1;
  for (std::size_t i = 1; i < x.rank(); ++i) c *= x.dim(i);
  return x.reshaped({x.dim(0), c});
}

// Checks a part of a wider and longer matrix `whole`.
void check_part(long column, long columns, long row0, long rows, const Tensor& whole) {
  if (column < 0 || column + columns > whole.dim(1))
    fail(Status::internal, "gather: columns {} to {} of {}", column, column + columns, whole.describe());
  if (row0 + rows > whole.dim(0))
    fail(Status::internal, "gather: rows {} to {} of {}", row0, row0 + rows, whole.describe());
}

}  // namespace

void gather_forward(Context& ctx, const GatherForward& a) {
  Dims d;
  d.bind("x", a.x, {"N", "C"})
      .bind("index", a.index, {"P"}, Type::i32)
      .bind("out", a.out, {a.row0 < 0 ? "P" : "rows", "W"});
  const long c = d["C"], p = d["P"], w = d["W"], row0 = std::max(a.row0, 0L);
  check_part(a.column, c, row0, p, a.out);
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, p) : groups(1, 32, p);
  ctx.launch({"gather", "gather_forward", ""}, range, {0, 8.0 * static_cast<double>(p) * static_cast<double>(c)}, a.x,
             a.index, c == w ? written(a.out, row0 * w, p * w) : written_somewhere(a.out), p, c, w, a.column, a.shared,
             row0);
}

void gather_backward(Context& ctx, const GatherBackward& a) {
  Dims d;
  d.bind("dx", a.dx, {"N", "C"})
      .bind("index", a.index, {"P"}, Type::i32)
      .bind("dout", a.dout, {a.row0 < 0 ? "P" : "rows", "W"});
  const long c = d["C"], p = d["P"], w = d["W"], row0 = std::max(a.row0, 0L);
  check_part(a.column, c, row0, p, a.dout);
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, p) : groups(1, 32, p);
  ctx.launch({"gather", "gather_backward", ""}, range,
             {static_cast<double>(p) * static_cast<double>(c), 12.0 * static_cast<double>(p) * static_cast<double>(c)},
             a.dout, a.index, written(a.dx), p, c, w, a.column, a.shared, row0);
}

Tensor gather_integers(Context& ctx, const Tensor& x, const Tensor& index) {
  const long p = Dims().bind("x", x, {"N"}, Type::i32).bind("index", index, {"P"}, Type::i32)["P"];
  const Tensor out = ctx.tensor({p}, Type::i32, "gather.integers");
  ctx.launch({"gather", "gather_integers", ""}, items(p), {0, 12.0 * static_cast<double>(p)}, x, index, written(out),
             p);
  return out;
}

DeviceGaussians gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index) {
  const long p = index.dim(0);
  const auto rows = [&](const Shape& shape, const char* what) { return ctx.tensor(shape, Type::f32, what); };
  const DeviceGaussians out{rows({p, 3}, "gather.means"), rows({p, g.scales.dim(1)}, "gather.scales"),
                            rows({p, 4}, "gather.quats"), rows({p}, "gather.opacities"),
                            rows({p, g.sh.dim(1), 3}, "gather.sh")};
  gather_forward(ctx, g, index, out, 0);
  return out;
}

void gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index, const DeviceGaussians& out,
                    long row0) {
  const auto rows = [&](const Tensor& from, const Tensor& to) {
    const Tensor source = rows_of(from), target = rows_of(to);
    Dims().bind("x", source, {"N", "C"}).bind("out", target, {"rows", "C"});  // whole rows
    gather_forward(ctx, {source, index, target, 0, 1, row0});
  };
  rows(g.means, out.means);
  rows(g.scales, out.scales);
  rows(g.quats, out.quats);
  rows(g.opacities, out.opacities);
  rows(g.sh, out.sh);
}

void gather_backward(Context& ctx, const GaussianGradients& dout, const Tensor& index, const GaussianGradients& dx,
                     long row0) {
  const auto rows = [&](const Tensor& from, const Tensor& to) {
    if (!from) return;
    const Tensor source = rows_of(from), target = rows_of(to);
    Dims().bind("dout", source, {"rows", "C"}).bind("dx", target, {"N", "C"});  // whole rows
    gather_backward(ctx, {source, index, target, 0, 1, row0});
  };
  rows(dout.means, dx.means);
  rows(dout.scales, dx.scales);
  rows(dout.quats, dx.quats);
  rows(dout.opacities, dx.opacities);
  rows(dout.sh, dx.sh);
}

}  // namespace vsplat
