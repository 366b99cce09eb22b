#include "bench/ops/drawing.h"

#include "bench/ops/operation.h"
#include "bench/scenes.h"

namespace vsplat::bench {

Drawing::Drawing(Context& ctx) {
  const BenchScene scene = make_scene("object-190k");
  const Camera& camera = scene.cameras.front();
  gaussians = upload(ctx, scene.scene.gaussians);
  width = camera.width, height = camera.height;
  views = upload_views(ctx, {camera}, scene.scene.near, scene.scene.mirror);
  culled = make_culled(ctx, gaussians.count());
  part = {0, 0, static_cast<int>(tiles_along(width)), static_cast<int>(tiles_along(height))};
  project_cull(ctx, gaussians, 0, views, 0, width, height, culled);
  count = count_visible(ctx, culled, part);
  projected = compact_visible(ctx, culled, part, count);
  project_forward(ctx, project_all());
}

ProjectForward Drawing::project_all() const {
  return {gaussians, 0, views, 0, projected.ids, 0, projected.ids.dim(0), projected.records};
}

Projected Drawing::for_sorting(Context& ctx) const {
  Projected out = projected;
  out.keys = ctx.tensor(projected.keys.shape(), projected.keys.type());
  ctx.copy(projected.keys, out.keys);
  return out;
}

Binned Drawing::bin(Context& ctx, bool slots) const {
  return tile_bin(ctx, for_sorting(ctx), count.intersections, part, {slots});
}

RasterizeForward Drawing::blend(Context& ctx, const Binned& binned) const {
  return {projected, binned, part, {}, make_picture(ctx, width, height)};
}

RasterizeBackward Drawing::blend_backward(Context& ctx, const Binned& binned) const {
  const RasterizeForward forward = blend(ctx, binned);
  rasterize_forward(ctx, forward);
  const auto like = [&](const Tensor& t, std::uint32_t seed) { return random(ctx, t.shape(), seed); };
  const DevicePicture& picture = forward.picture;
  return {projected, binned,  part,
          {},        picture, {like(picture.colour, 1), like(picture.alpha, 2), like(picture.depth, 3)}};
}

}  // namespace vsplat::bench
