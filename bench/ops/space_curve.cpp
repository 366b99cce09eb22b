// 12,000 points, as GenDen chooses.
#include "model/ops/volume/space_curve.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kCurvePoints = 12000, kCurveRun = 48;

Tensor curve_points(Context& ctx) { return random(ctx, {kCurvePoints, 3}, 1, -0.5f, 0.5f); }

}  // namespace

std::vector<Case> space_curve_cases(const Options&) {
  return {
      {"cells",
       [](Context& ctx) {
         const Tensor at = curve_points(ctx);
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx, [&ctx, at, out] { *out = grid_cells(ctx, at, 1.0 / 64).cells; }, [out] { return std::vector{*out}; });
       }},
      {"codes",
       [](Context& ctx) {
         const GridCells cells = grid_cells(ctx, curve_points(ctx), 1.0 / 64);
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx, [&ctx, cells, out] { *out = curve_codes(ctx, cells, Curve::hilbert, false); },
             [out] { return std::vector{*out}; });
       }},
      {"runs",
       [](Context& ctx) {
         std::vector<std::uint32_t> order(kCurvePoints);
         for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::uint32_t>(i);
         const Tensor along = ctx.upload({kCurvePoints}, order, Type::u32);
         const auto out = std::make_shared<CurveRuns>();
         return operation_with(
             ctx, [&ctx, along, out] { *out = curve_runs(ctx, along, kCurveRun); },
             [out] {
               return std::vector{out->slots, out->places};
             });
       }},
  };
}

}  // namespace vsplat::bench
