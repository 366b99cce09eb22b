#include "model/ops/render/tile_bin.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {

std::vector<Case> tile_bin_cases(const Options&) {
  return {
      {"pairs",
       [](Context& ctx) {
         const Drawing d(ctx);
         const auto out = std::make_shared<Binned>();
         return operation_with(
             ctx, [&ctx, d, out] { *out = tile_bin(ctx, d.for_sorting(ctx), d.count.intersections, d.part, {false}); },
             [out] {
               return std::vector{out->ids, out->starts};
             });
       }},
      {"pairs with slots",
       [](Context& ctx) {
         const Drawing d(ctx);
         const auto out = std::make_shared<Binned>();
         return operation_with(
             ctx, [&ctx, d, out] { *out = tile_bin(ctx, d.for_sorting(ctx), d.count.intersections, d.part, {true}); },
             [out] {
               return std::vector{out->ids, out->offsets, out->slots};
             });
       }},
  };
}

}  // namespace vsplat::bench
