#include "model/ops/render/rasterize.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {

std::vector<Case> rasterize_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const Drawing d(ctx);
         const RasterizeForward a = d.blend(ctx, d.bin(ctx, false));
         return operation(ctx, [&ctx, a] { rasterize_forward(ctx, a); },
                          {a.picture.colour, a.picture.alpha, a.picture.depth});
       }},
      {"backward",
       [](Context& ctx) {
         const Drawing d(ctx);
         const RasterizeBackward a = d.blend_backward(ctx, d.bin(ctx, true));
         const auto out = std::make_shared<IntersectionGradients>();
         return operation_with(
             ctx, [&ctx, a, out] { *out = rasterize_backward(ctx, a); },
             [&ctx, out] { return written_rows(ctx, *out); });
       }},
      {"pulls",
       [](Context& ctx) {
         const Drawing d(ctx);
         RasterizeBackward a = d.blend_backward(ctx, d.bin(ctx, true));
         a.pulls = Pulls::through;
         const auto out = std::make_shared<IntersectionGradients>();
         return operation_with(
             ctx, [&ctx, a, out] { *out = rasterize_backward(ctx, a); },
             [&ctx, out] { return written_rows(ctx, *out); });
       }},
  };
}

}  // namespace vsplat::bench
