#include "model/ops/gather.h"

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

}  // namespace

void gather_forward(Context& ctx, const GatherForward& a) {
  Dims d;
  d.bind("x", a.x, {"N", "C"}).bind("index", a.index, {"P"}, Type::i32).bind("out", a.out, {"P", "W"});
  const long c = d["C"], p = d["P"], w = d["W"];
  if (a.column < 0 || a.column + c > w) {
    fail(Status::internal, "gather: columns {} to {} of {}", a.column, a.column + c, a.out.describe());
  }
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, p) : groups(1, 32, p);
  ctx.launch({"gather", "gather_forward", ""}, range, {0, 8.0 * static_cast<double>(p) * static_cast<double>(c)}, a.x,
             a.index, c == w ? written(a.out) : written_somewhere(a.out), p, c, w, a.column, a.shared);
}

void gather_backward(Context& ctx, const GatherBackward& a) {
  Dims d;
  d.bind("dx", a.dx, {"N", "C"}).bind("index", a.index, {"P"}, Type::i32).bind("dout", a.dout, {"P", "W"});
  const long c = d["C"], p = d["P"], w = d["W"];
  if (a.column < 0 || a.column + c > w) {
    fail(Status::internal, "gather_backward: columns {} to {} of {}", a.column, a.column + c, a.dout.describe());
  }
  const Range range = ctx.flavour() == Flavour::cpu ? groups(1, 1, p) : groups(1, 32, p);
  ctx.launch({"gather", "gather_backward", ""}, range,
             {static_cast<double>(p) * static_cast<double>(c), 12.0 * static_cast<double>(p) * static_cast<double>(c)},
             a.dout, a.index, written(a.dx), p, c, w, a.column, a.shared);
}

DeviceGaussians gather_forward(Context& ctx, const DeviceGaussians& g, const Tensor& index) {
  const long p = index.dim(0);
  const auto rows = [&](const Tensor& x, const Shape& shape, const char* what) {
    const Tensor out = ctx.tensor(shape, Type::f32, what);
    gather_forward(ctx, {rows_of(x), index, rows_of(out)});
    return out;
  };
  DeviceGaussians out;
  out.means = rows(g.means, {p, 3}, "gather.means");
  out.scales = rows(g.scales, {p, g.scales.dim(1)}, "gather.scales");
  out.quats = rows(g.quats, {p, 4}, "gather.quats");
  out.opacities = rows(g.opacities, {p}, "gather.opacities");
  out.sh = rows(g.sh, {p, g.sh.dim(1), 3}, "gather.sh");
  return out;
}

void gather_backward(Context& ctx, const GaussianGradients& dout, const Tensor& index, const GaussianGradients& dx) {
  const auto rows = [&](const Tensor& from, const Tensor& to) {
    if (!from) return;
    const Tensor source = rows_of(from), target = rows_of(to);
    Dims().bind("dout", source, {"P", "C"}).bind("dx", target, {"N", "C"});  // whole rows
    gather_backward(ctx, {source, index, target});
  };
  rows(dout.means, dx.means);
  rows(dout.scales, dx.scales);
  rows(dout.quats, dx.quats);
  rows(dout.opacities, dx.opacities);
  rows(dout.sh, dx.sh);
}

}  // namespace vsplat
