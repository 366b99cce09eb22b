#include "model/ops/volume/space_curve.h"

#include <algorithm>
#include <bit>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr int kMostDepth = 16;
constexpr long kCurveBlock = 64;  // points of a work-item that looks for the least or the most

long curve_blocks(long n) { return (n + kCurveBlock - 1) / kCurveBlock; }

Tensor least_of(Context& ctx, Tensor points) {
  do {
    const long n = points.dim(0);
    const Tensor least = ctx.tensor({curve_blocks(n), 3}, Type::f32, "space_curve.least");
    ctx.launch({"space_curve", "space_curve_least", ""}, items(curve_blocks(n)),
               {3.0 * static_cast<double>(n), 12.0 * static_cast<double>(n)}, points, written(least), n, kCurveBlock);
    points = least;
  } while (points.dim(0) > 1);
  return points;
}

}  // namespace

GridCells grid_cells(Context& ctx, const Tensor& points, double cell) {
  const long p = Dims().bind("points", points, {"P", "3"})["P"];
  if (p < 1 || !(cell > 0)) fail(Status::internal, "grid_cells: {} in cells of {}", points.describe(), cell);
  const Tensor least = least_of(ctx, points);
  GridCells out;
  out.cells = ctx.tensor({p, 3}, Type::i32, "space_curve.cells");
  const Tensor most = ctx.tensor({curve_blocks(p)}, Type::i32, "space_curve.most");
  ctx.launch({"space_curve", "space_curve_cells", ""}, items(curve_blocks(p)),
             {6.0 * static_cast<double>(p), 24.0 * static_cast<double>(p)}, points, least, written(out.cells),
             written(most), p, kCurveBlock, static_cast<float>(cell));
  const Tensor largest = ctx.tensor({1}, Type::i32, "space_curve.largest");
  ctx.launch({"space_curve", "space_curve_most", ""}, items(1, 1), {0, 4.0 * static_cast<double>(most.count())}, most,
             written(largest), most.count());
  out.depth = kMostDepth;
  if (ctx.planning()) return out;
  const auto cells = static_cast<unsigned>(std::max(ctx.read<int>(largest)[0], 0));
  out.depth = std::max(1, static_cast<int>(std::bit_width(cells)));
  if (out.depth > kMostDepth)
    fail(Status::input,
         "points spread over more than {} cells of {}: the densifier's grid has at most {} bits along an axis",
         1 << kMostDepth, cell, kMostDepth);
  return out;
}

Tensor curve_codes(Context& ctx, const GridCells& cells, Curve curve, bool exchanged) {
  const long p = Dims().bind("cells", cells.cells, {"P", "3"}, Type::i32)["P"];
  const Tensor out = ctx.tensor({p}, Type::u64, "space_curve.codes");
  ctx.launch({"space_curve", "space_curve_codes", ""}, items(p), {0, 20.0 * static_cast<double>(p)}, cells.cells,
             written(out), p, curve == Curve::hilbert ? 1 : 0, exchanged ? 1 : 0, cells.depth);
  return out;
}

CurveRuns curve_runs(Context& ctx, const Tensor& order, long size) {
  const long p = Dims().bind("order", order, {"P"}, Type::u32)["P"];
  if (size < 1) fail(Status::internal, "curve_runs: runs of {}", size);
  CurveRuns out;
  out.size = std::min(size, std::max(p, 1L));
  out.runs = (p + out.size - 1) / out.size;
  const long slots = out.runs * out.size;
  out.slots = ctx.tensor({slots}, Type::i32, "space_curve.slots");
  out.places = ctx.tensor({p}, Type::i32, "space_curve.places");
  out.filled = ctx.tensor({slots - p}, Type::i32, "space_curve.filled");
  ctx.launch({"space_curve", "space_curve_runs", ""}, items(slots), {0, 12.0 * static_cast<double>(slots)}, order,
             written(out.slots), written(out.places), written(out.filled), p, slots, out.size);
  return out;
}

}  // namespace vsplat
