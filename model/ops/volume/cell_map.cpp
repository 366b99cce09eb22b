#include "model/ops/volume/cell_map.h"

#include "model/ops/dense/scatter_rows.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

template <class Arguments>
long bind_cells(Dims& d, const Arguments& a) {
  d.bind("cells", a.cells.cells, {"P", "3"}, Type::i32)
      .bind("codes", a.codes, {"P"}, Type::u64)
      .bind("points", a.points, {"P"}, Type::u32)
      .bind("standing", a.standing, {"P"}, Type::i32)
      .bind("map", a.map, {"P", "27"}, Type::i32);
  if (2 * d["P"] >= 1L << 31) fail(Status::memory, "cell_map: {} points, fewer than 2^30 are expected", d["P"]);
  return d["P"];
}

}  // namespace

void cell_map_forward(Context& ctx, const CellMapForward& a) {
  Dims d;
  const long p = bind_cells(d, a);
  ctx.launch({"cell_map", "cell_map_forward", ""}, items(p), {0, 132.0 * static_cast<double>(p)}, a.cells.cells,
             a.codes, a.points, written(a.standing), written(a.map), p, a.cells.depth, a.all ? 1 : 0);
}

void cell_map_backward(Context& ctx, const CellMapBackward& a) {
  Dims d;
  const long p = bind_cells(d, a);
  ctx.launch({"cell_map", "cell_map_backward", ""}, items(p), {0, 136.0 * static_cast<double>(p)}, a.cells.cells,
             a.codes, a.points, a.standing, written(a.map), p, a.cells.depth, a.all ? 1 : 0);
}

Tensor cell_sums(Context& ctx, const Tensor& x, const Tensor& standing) {
  Dims d;
  d.bind("x", x, {"P", "C"}).bind("standing", standing, {"P"}, Type::i32);
  const long p = d["P"], c = d["C"];
  const Tensor out = ctx.tensor({2 * p, c}, Type::f32, "cell_map.sums"), sums = ctx.tensor({p, c});
  ctx.fill_zero(sums);
  const Tensor ones = ctx.upload({p}, std::vector<float>(static_cast<std::size_t>(p), 1.0f));
  const ScatterPlan plan = make_scatter_plan(ctx, standing, ones, p);
  scatter_rows(ctx, {&plan, x, 0, 1, 1, sums});
  const long n = p * c;
  ctx.launch({"cell_map", "cell_map_halves", ""}, items(n), {0, 16.0 * static_cast<double>(n)}, x, sums, written(out),
             n);
  return out;
}

}  // namespace vsplat
