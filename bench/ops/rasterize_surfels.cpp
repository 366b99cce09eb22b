#include "model/ops/render/rasterize_surfels.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {

std::vector<Case> rasterize_surfels_cases(const Options&) {
  const auto forward = [](const SurfelMaps& maps) {
    return [maps](Context& ctx) {
      const SurfelDrawing d(ctx);
      RasterizeSurfelsForward a = d.blend(ctx, d.bin(ctx, false));
      a.picture = d.picture(ctx, maps);
      return operation(ctx, [&ctx, a] { rasterize_surfels_forward(ctx, a); },
                       {a.picture.colour, a.picture.alpha, a.picture.depth});
    };
  };
  return {
      {"forward", forward({true, true, true})},
      {"forward-colour", forward({})},
      {"backward",
       [](Context& ctx) {
         const SurfelDrawing d(ctx);
         const RasterizeSurfelsBackward a = d.blend_backward(ctx, d.bin(ctx, true));
         const auto out = std::make_shared<IntersectionGradients>();
         return operation_with(
             ctx, [&ctx, a, out] { *out = rasterize_surfels_backward(ctx, a); },
             [&ctx, out] { return written_rows(ctx, *out); });
       }},
  };
}

}  // namespace vsplat::bench
