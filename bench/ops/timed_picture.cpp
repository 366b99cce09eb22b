#include "bench/ops/timed_picture.h"

#include <algorithm>

#include "bench/ops/operation.h"
#include "bench/scenes.h"

namespace vsplat::bench {
namespace {

PictureGradient random_gradient(Context& ctx, const DevicePicture& p) {
  const auto like = [&](const Tensor& t, std::uint32_t seed) { return t ? random(ctx, t.shape(), seed) : Tensor(); };
  return {like(p.colour, 1), like(p.alpha, 2), like(p.depth, 3), like(p.normal, 4), like(p.distortion, 5)};
}

Gaussians flattened(Gaussians g) {
  g.kind = GaussianKind::surfel;
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t i = 0; i < 2; ++i) g.scales[2 * k + i] = g.scales[3 * k + i];
  g.scales.resize(2 * g.count);
  return g;
}

}  // namespace

Culling::Culling(Context& ctx, GaussianKind kind) {
  const BenchScene scene = make_scene("object-190k");
  const Camera& camera = scene.cameras.front();
  const bool surfels = kind == GaussianKind::surfel;
  gaussians = upload(ctx, surfels ? flattened(scene.scene.gaussians) : scene.scene.gaussians);
  width = camera.width, height = camera.height;
  views = upload_views(ctx, {camera}, scene.scene.near, scene.scene.mirror);
  culled = make_culled(ctx, gaussians.count());
  part = {0, 0, static_cast<int>(tiles_along(width)), static_cast<int>(tiles_along(height))};
  if (surfels)
    project_surfels_cull(ctx, gaussians, 0, views, 0, width, height, SurfelRevision::lara, culled);
  else
    project_cull(ctx, gaussians, 0, views, 0, width, height, culled);
  count = count_visible(ctx, culled, part);
  projected = compact_visible(ctx, culled, part, count, surfels ? kSurfelRecord : kRecord);
}

Projected Culling::for_sorting(Context& ctx) const {
  Projected out = projected;
  out.keys = ctx.tensor(projected.keys.shape(), projected.keys.type());
  ctx.copy(projected.keys, out.keys);
  return out;
}

Binned Culling::bin(Context& ctx, bool slots) const {
  return tile_bin(ctx, for_sorting(ctx), count.intersections, part, {slots});
}

Drawing::Drawing(Context& ctx) : Culling(ctx, GaussianKind::volume) { project_forward(ctx, project_all()); }

ProjectForward Drawing::project_all() const {
  return {gaussians, 0, views, 0, projected.ids, 0, projected.ids.dim(0), projected.records};
}

RasterizeForward Drawing::blend(Context& ctx, const Binned& binned) const {
  return {projected, binned, part, {}, picture(ctx)};
}

RasterizeBackward Drawing::blend_backward(Context& ctx, const Binned& binned) const {
  const RasterizeForward forward = blend(ctx, binned);
  rasterize_forward(ctx, forward);
  return {projected, binned, part, {}, forward.picture, random_gradient(ctx, forward.picture)};
}

SurfelDrawing::SurfelDrawing(Context& ctx) : Culling(ctx, GaussianKind::surfel) {
  project_surfels_forward(ctx, project_all());
}

ProjectSurfelsForward SurfelDrawing::project_all() const {
  return {gaussians, 0, views, 0, projected.ids, 0, projected.ids.dim(0), projected.records};
}

RasterizeSurfelsForward SurfelDrawing::blend(Context& ctx, const Binned& binned) const {
  return {projected, binned, part, {}, picture(ctx, {true, true, true})};
}

RasterizeSurfelsBackward SurfelDrawing::blend_backward(Context& ctx, const Binned& binned) const {
  const RasterizeSurfelsForward forward = blend(ctx, binned);
  rasterize_surfels_forward(ctx, forward);
  return {projected, binned, part, {}, forward.picture, random_gradient(ctx, forward.picture)};
}

std::vector<Tensor> written_rows(Context& ctx, const IntersectionGradients& gradients) {
  std::vector<float> rows = ctx.read<float>(gradients.rows);
  const std::vector<std::uint8_t> touched = ctx.read<std::uint8_t>(gradients.touched);
  const auto columns = static_cast<std::size_t>(gradients.rows.dim(1));
  for (std::size_t i = 0; i < touched.size(); ++i)
    if (!touched[i]) std::fill_n(rows.begin() + static_cast<std::ptrdiff_t>(i * columns), columns, 0.0f);
  return {ctx.upload(gradients.rows.shape(), rows)};
}

}  // namespace vsplat::bench
