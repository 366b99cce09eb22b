#include "model/ops/networks/lara_maps.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/ops/timed_picture.h"

namespace vsplat::bench {
namespace {

struct Drawn {
  explicit Drawn(Context& ctx) {
    const SurfelDrawing d(ctx);
    const RasterizeSurfelsForward a = d.blend(ctx, d.bin(ctx, false));
    rasterize_surfels_forward(ctx, a);
    picture = a.picture;
    views = d.views;
  }
  DevicePicture picture;
  Tensor views;
};

}  // namespace

std::vector<Case> lara_maps_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const Drawn d(ctx);
         const auto out = std::make_shared<LaraMaps>();
         return operation_with(
             ctx,
             [&ctx, d, out] {
               *out = lara_maps_forward(ctx, {d.picture, d.views, 0});
             },
             [out] {
               return std::vector{out->image, out->depth, out->normal, out->depth_normal};
             });
       }},
      {"backward",
       [](Context& ctx) {
         const Drawn d(ctx);
         const auto like = [&](const Tensor& map, std::uint32_t seed) { return random(ctx, map.shape(), seed); };
         const DevicePicture& p = d.picture;
         const LaraMapsGradient by{like(p.colour, 1), like(p.alpha, 2),  like(p.depth, 3),
                                   like(p.normal, 4), like(p.normal, 5), {}};
         const auto out = std::make_shared<PictureGradient>();
         return operation_with(
             ctx,
             [&ctx, d, by, out] {
               *out = lara_maps_backward(ctx, {d.picture, d.views, 0, by});
             },
             [out] {
               return std::vector{out->colour, out->alpha, out->depth, out->normal};
             });
       }},
  };
}

}  // namespace vsplat::bench
