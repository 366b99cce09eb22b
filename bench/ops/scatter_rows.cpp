// Four texels of each of four views' maps for every selected voxel.
#include "model/ops/dense/scatter_rows.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kMaps = kViews * kTokens * kTokens;

struct Samples {
  Tensor index, weight;
};

Samples samples(Context& ctx) {
  const long entries = kSelected * kViews * 4;
  std::vector<int> index(static_cast<std::size_t>(entries));
  std::mt19937 engine(1);
  for (int& row : index) row = static_cast<int>(engine() % static_cast<unsigned>(kMaps));
  return {ctx.upload({entries}, index, Type::i32), random(ctx, {entries}, 2, 0.1f, 1.0f)};
}

}  // namespace

std::vector<Case> scatter_rows_cases(const Options&) {
  return {
      {"plan",
       [](Context& ctx) {
         const auto plan = std::make_shared<ScatterPlan>();
         const Samples s = samples(ctx);
         return operation_with(
             ctx, [&ctx, s, plan] { *plan = make_scatter_plan(ctx, s.index, s.weight, kMaps); },
             [plan] {
               return std::vector{plan->from, plan->starts};
             });
       }},
      {"rows",
       [](Context& ctx) {
         const Samples s = samples(ctx);
         const auto plan = std::make_shared<ScatterPlan>(make_scatter_plan(ctx, s.index, s.weight, kMaps));
         ScatterRows a;
         a.plan = plan.get(), a.d = random(ctx, {kSelected, kDim}, 3), a.per_row = 4 * kViews;
         a.out = random(ctx, {kMaps, kDim}, 4);
         return operation(ctx, [&ctx, a, plan] { scatter_rows(ctx, a); }, {a.out});
       }},
  };
}

}  // namespace vsplat::bench
