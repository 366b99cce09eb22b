#include "model/ops/render/visible.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {

std::vector<Case> visible_cases(const Options&) {
  return {
      {"count",
       [](Context& ctx) {
         const Drawing d(ctx);
         return operation(ctx, [&ctx, d] { count_visible(ctx, d.culled, d.part); }, {d.culled.sums});
       }},
      {"compact",
       [](Context& ctx) {
         const Drawing d(ctx);
         const auto out = std::make_shared<Projected>();
         return operation_with(
             ctx, [&ctx, d, out] { *out = compact_visible(ctx, d.culled, d.part, d.count); },
             [out] {
               return std::vector{out->ids, out->keys};
             });
       }},
  };
}

}  // namespace vsplat::bench
