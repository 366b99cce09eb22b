// 12,000 points in the cells of a grid, as GenDen chooses.
#include "model/ops/volume/cell_map.h"

#include <memory>

#include "bench/ops/operation.h"
#include "model/ops/render/radix_sort.h"

namespace vsplat::bench {
namespace {

constexpr long kCellPoints = 12000, kCellChannels = 160;

CellMapForward points_in_cells(Context& ctx) {
  CellMapForward out;
  out.cells = grid_cells(ctx, random(ctx, {kCellPoints, 3}, 1, -0.5f, 0.5f), 1.0 / 64);
  const Sorted sorted = radix_sort(ctx, curve_codes(ctx, out.cells, Curve::morton, false), {}, 3 * out.cells.depth);
  out.codes = sorted.keys, out.points = sorted.values;
  out.standing = ctx.tensor({kCellPoints}, Type::i32), out.map = ctx.tensor({kCellPoints, 27}, Type::i32);
  return out;
}

}  // namespace

std::vector<Case> cell_map_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const CellMapForward a = points_in_cells(ctx);
         return operation(ctx, [&ctx, a] { cell_map_forward(ctx, a); }, {a.standing, a.map});
       }},
      {"backward",
       [](Context& ctx) {
         const CellMapForward f = points_in_cells(ctx);
         cell_map_forward(ctx, f);
         const CellMapBackward a{f.cells, f.codes,    f.points,
                                 f.all,   f.standing, ctx.tensor({kCellPoints, 27}, Type::i32)};
         return operation(ctx, [&ctx, a] { cell_map_backward(ctx, a); }, {a.map});
       }},
      {"sums",
       [](Context& ctx) {
         const CellMapForward f = points_in_cells(ctx);
         cell_map_forward(ctx, f);
         const Tensor x = random(ctx, {kCellPoints, kCellChannels}, 2);
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx, [&ctx, x, f, out] { *out = cell_sums(ctx, x, f.standing); }, [out] { return std::vector{*out}; });
       }},
  };
}

}  // namespace vsplat::bench
