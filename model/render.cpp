#include "model/render.h"

namespace vsplat {
namespace {

void check_size(const Camera& camera) {
  if (static_cast<double>(camera.width) * camera.height * 3 >= 2147483648.0)
    fail(Status::memory, "a picture of {} x {} pixels: at most 715827882 in all can be drawn", camera.width,
         camera.height);
}

Projected project_view(Context& ctx, const DeviceGaussians& g, const Camera& camera, const RenderOptions& options) {
  check_size(camera);
  const Tensor view = upload_views(ctx, {camera}, options.near, options.mirror);
  return project(ctx, g, view, 0, camera.width, camera.height);
}

std::uint64_t assumed(const DeviceGaussians& g, const RenderOptions& options) {
  return static_cast<std::uint64_t>(options.assumed_tiles * static_cast<double>(g.count()));
}

}  // namespace

std::uint64_t count_intersections(Context& ctx, const DeviceGaussians& g, const Camera& camera,
                                  const RenderOptions& options) {
  const Stage stage(ctx, "splat");
  const std::uint64_t count = count_intersections(ctx, project_view(ctx, g, camera, options));
  return ctx.planning() ? assumed(g, options) : count;
}

DevicePicture render(Context& ctx, const DeviceGaussians& g, const Camera& camera, const RenderOptions& options) {
  const Stage stage(ctx, "splat");
  const Projected projected = project_view(ctx, g, camera, options);
  std::uint64_t count = count_intersections(ctx, projected);
  if (ctx.planning()) count = assumed(g, options);
  const Binned binned = tile_bin(ctx, projected, count, camera.width, camera.height);
  return rasterize(ctx, projected, binned, camera.width, camera.height, options.background);
}

Picture download(Context& ctx, const DevicePicture& picture) {
  const int height = static_cast<int>(picture.alpha.dim(0)), width = static_cast<int>(picture.alpha.dim(1));
  Picture out{Image(width, height, 3), Image(width, height, 1), Image(width, height, 1)};
  if (ctx.planning()) return out;
  ctx.read(picture.colour, out.colour.data.data());
  ctx.read(picture.alpha, out.alpha.data.data());
  ctx.read(picture.depth, out.depth.data.data());
  return out;
}

Picture render_picture(Context& ctx, const DeviceGaussians& g, const Camera& camera, const RenderOptions& options) {
  return download(ctx, render(ctx, g, camera, options));
}

}  // namespace vsplat
