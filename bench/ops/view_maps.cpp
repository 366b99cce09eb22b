#include "model/ops/networks/view_maps.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

ViewDrawings drawings(Context& ctx, std::uint32_t seed) {
  return {random(ctx, {1, kImage, kImage, 3}, seed), random(ctx, {1, kImage, kImage}, seed + 1, 0.1f, 1),
          random(ctx, {1, kImage, kImage}, seed + 2, 1, 2)};
}

}  // namespace

// One view of four.
std::vector<Case> view_maps_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         ViewMapsForward a{random(ctx, {kViews, kImage, kImage, 3}, 1), drawings(ctx, 2), 0, true,
                           random(ctx, {kViews, kImage, kImage, 8}, 5)};
         return operation(ctx, [&ctx, a] { view_maps_forward(ctx, a); }, {a.maps});
       }},
      {"backward",
       [](Context& ctx) {
         ViewMapsBackward a{drawings(ctx, 2), 0, true, random(ctx, {kViews, kImage, kImage, 8}, 5), drawings(ctx, 6)};
         return operation(ctx, [&ctx, a] { view_maps_backward(ctx, a); }, {a.ddrawings.colour, a.ddrawings.depth});
       }},
  };
}

}  // namespace vsplat::bench
