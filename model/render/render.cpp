#include "model/render/render.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "model/ops/render/area_mean.h"
#include "model/ops/render/tile_bin.h"
#include "model/render/reserve.h"
#include "model/render/supersample.h"
#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

void check_size(const Camera& camera) {
  if (static_cast<double>(camera.width) * camera.height * 3 >= 2147483648.0)
    fail(Status::memory, "a picture of {} x {} pixels: at most 715827882 in all can be drawn", camera.width,
         camera.height);
}

Part whole(const Camera& camera) {
  return {0, 0, static_cast<int>(tiles_along(camera.width)), static_cast<int>(tiles_along(camera.height))};
}

// The camera, and the culling result for every Gaussian.
struct View {
  Tensor camera;
  Culled culled;
};

View cull(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options) {
  const Stage stage(ctx, "project");
  View out{upload_views(ctx, {camera}, options.near, options.mirror), make_culled(ctx, scene.count)};
  for (long i = 0; i < scene.chunks(); ++i) {
    const DeviceGaussians chunk = scene.get(ctx, i);
    const long base = i * scene.chunk;
    if (scene.kind == GaussianKind::surfel)
      project_surfels_cull(ctx, chunk, base, out.camera, 0, camera.width, camera.height, options.revision, out.culled);
    else
      project_cull(ctx, chunk, base, out.camera, 0, camera.width, camera.height, out.culled, options.antialias);
  }
  return out;
}

View cull_reserved(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options) {
  check_size(camera);
  reserve_for(ctx, [&](Context& c) { cull(c, scene, camera, options); });
  return cull(ctx, scene, camera, options);
}

// Counts for a plan. The distribution over chunks is unknown: each may hold all Gaussians.
VisibleCount assumed(const GaussianChunks& scene, const RenderOptions& options, const Part& part) {
  if (options.counts) return options.counts(part);
  VisibleCount out;
  out.gaussians = static_cast<std::uint64_t>(scene.count);
  out.intersections = static_cast<std::uint64_t>(options.assumed_tiles * static_cast<double>(scene.count));
  out.largest_key = 0xffffffffu;
  return out;
}

Projected project_part(Context& ctx, const GaussianChunks& scene, const View& view, const RenderOptions& options,
                       const Part& part, const VisibleCount& count) {
  const Stage stage(ctx, "project");
  const bool surfels = scene.kind == GaussianKind::surfel;
  Projected out = compact_visible(ctx, view.culled, part, count, surfels ? kSurfelRecord : kRecord);
  out.camera = view.camera;
  for (long i = 0; i < scene.chunks(); ++i) {
    if (ctx.planning()) {  // plan as if all were in the first chunk: the launch itself takes no memory
      const DeviceGaussians chunk = scene.get(ctx, i);
      const long all = i == 0 ? out.ids.dim(0) : 0;
      if (surfels)
        project_surfels_forward(ctx, {chunk, 0, view.camera, 0, out.ids, 0, all, out.records, options.revision});
      else
        project_forward(ctx, {chunk, 0, view.camera, 0, out.ids, 0, all, out.records, options.antialias});
      continue;
    }
    const auto seen_before = [&](long gaussian) {
      return static_cast<long>(count.before.at(static_cast<std::size_t>((gaussian + count.block - 1) / count.block)));
    };
    const long from = seen_before(i * scene.chunk), to = seen_before(i * scene.chunk + scene.size_of(i));
    if (from == to) continue;
    const DeviceGaussians chunk = scene.get(ctx, i);
    const long base = i * scene.chunk;
    if (surfels)
      project_surfels_forward(ctx,
                              {chunk, base, view.camera, 0, out.ids, from, to - from, out.records, options.revision});
    else
      project_forward(ctx, {chunk, base, view.camera, 0, out.ids, from, to - from, out.records, options.antialias});
  }
  return out;
}

VisibleCount count_part(Context& ctx, const View& view, const Part& part) {
  const Stage stage(ctx, "project");
  return count_visible(ctx, view.culled, part);
}

Binned sort_part(Context& ctx, const GaussianChunks& scene, const RenderOptions& options, const Part& part,
                 const Projected& projected, std::uint64_t intersections, bool slots) {
  const Stage stage(ctx, "sort");
  // A surfel's alpha within a tile cannot be bounded from its record alone.
  const bool exact = options.exact_tiles && scene.kind == GaussianKind::volume;
  return tile_bin(ctx, projected, intersections, part, {slots, exact});
}

// Splits across the longer side.
void split(const Part& part, std::vector<Part>& parts) {
  Part first = part, second = part;
  if (part.y1 - part.y0 >= part.x1 - part.x0)
    first.y1 = second.y0 = (part.y0 + part.y1) / 2;
  else
    first.x1 = second.x0 = (part.x0 + part.x1) / 2;
  parts.push_back(second);
  parts.push_back(first);
}

}  // namespace

void for_each_part(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                   bool slots, const PartWork& work) {
  const Stage stage(ctx, "splat");
  const RoundedSizes rounded(ctx.memory());
  View view = cull_reserved(ctx, scene, camera, options);
  std::vector<Part> parts{whole(camera)};
  std::optional<VisibleCount> first;  // of the whole picture
  if (options.counted && !ctx.planning()) {
    first = count_part(ctx, view, parts.front());
    if (options.counted(first->intersections)) {
      view = cull(ctx, scene, camera, options);
      first.reset();
    }
  }
  while (!parts.empty()) {
    const Part part = parts.back();
    parts.pop_back();
    VisibleCount count = first ? *std::exchange(first, std::nullopt) : count_part(ctx, view, part);
    if (ctx.planning()) {
      count = assumed(scene, options, part);
    } else if (options.most_pairs > 0 && count.intersections > options.most_pairs && part.tiles() > 1) {
      split(part, parts);
      continue;
    }
    const auto draw = [&](Context& c) {
      const Projected projected = project_part(c, scene, view, options, part, count);
      work(c, part, projected, sort_part(c, scene, options, part, projected, count.intersections, slots));
    };
    const std::array<std::uint64_t, 4> sizes{static_cast<std::uint64_t>(part.tiles()),
                                             static_cast<std::uint64_t>(scene.count), count.gaussians,
                                             count.intersections};
    if (options.repeated ? options.repeated->reserve(ctx, sizes, draw) : reserve_for(ctx, draw)) {
      draw(ctx);
    } else if (part.tiles() > 1) {
      split(part, parts);
    } else {
      fail(Status::memory,
           "not enough device memory: {} of {} Gaussians touch the tile of 16 x 16 pixels at {}, {} of {} x {}, which "
           "cannot be drawn in the {:.4g} GiB that may be used ({}) beside the {:.4g} GiB in use",
           count.gaussians, scene.count, part.x0 * kTile, part.y0 * kTile, camera.width, camera.height,
           gib(ctx.memory().limits().total), Option::max_memory, gib(ctx.memory().live()));
    }
  }
}

void draw_part(Context& ctx, const GaussianChunks& scene, const RenderOptions& options, const Part& part,
               const Projected& projected, const Binned& binned, const DevicePicture& picture) {
  const Stage stage(ctx, "rasterize");
  if (scene.kind == GaussianKind::surfel)
    rasterize_surfels_forward(ctx,
                              {projected, binned, part, options.background, picture, options.near, options.revision});
  else
    rasterize_forward(ctx, {projected, binned, part, options.background, picture});
}

DevicePicture reserved_picture(Context& ctx, const GaussianChunks& scene, const Camera& camera,
                               const SurfelMaps& maps) {
  check_size(camera);
  if (scene.kind != GaussianKind::surfel && (maps.normal || maps.median || maps.distortion))
    fail(Status::usage, "normals, median depths and distortion are those of surfels; these Gaussians are volumes");
  reserve_for(ctx, [&](Context& c) { make_picture(c, camera.width, camera.height, maps); });
  return make_picture(ctx, camera.width, camera.height, maps);
}

DevicePicture render(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options) {
  const Stage stage(ctx, "splat");
  const DevicePicture out = reserved_picture(ctx, scene, camera, options.maps);
  render_into(ctx, scene, camera, options, out);
  return out;
}

namespace {

// Draws at `supersample` times the size and averages.
void render_larger(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                   const DevicePicture& out) {
  RenderOptions once = options;
  once.supersample = 1;
  const SurfelMaps maps{static_cast<bool>(out.normal), static_cast<bool>(out.median),
                        static_cast<bool>(out.distortion)};
  const Camera larger = times_as_large(camera, options.supersample);
  const DevicePicture picture = reserved_picture(ctx, scene, larger, maps);
  render_into(ctx, scene, larger, once, picture);
  const Stage stage(ctx, "rasterize");
  for (Tensor DevicePicture::*const map :
       {&DevicePicture::colour, &DevicePicture::alpha, &DevicePicture::depth, &DevicePicture::normal,
        &DevicePicture::median, &DevicePicture::distortion, &DevicePicture::moments})
    if (out.*map) area_mean(ctx, {picture.*map, out.*map, options.supersample});
}

}  // namespace

void render_into(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                 const DevicePicture& out) {
  const Stage stage(ctx, "splat");
  if (options.supersample > 1) return render_larger(ctx, scene, camera, options, out);
  for_each_part(ctx, scene, camera, options, false,
                [&](Context& c, const Part& part, const Projected& projected, const Binned& binned) {
                  draw_part(c, scene, options, part, projected, binned, out);
                });
}

void plan_render(Context& ctx, const GaussianChunks& scene, Context& planner, const GaussianChunks& planned,
                 const Camera& camera, const RenderOptions& options) {
  const View view = cull_reserved(ctx, scene, times_as_large(camera, options.supersample), options);
  RenderOptions counted = options;
  counted.counts = [&](const Part& part) { return count_part(ctx, view, part); };
  render(planner, planned, camera, counted);
}

Picture download(Context& ctx, const DevicePicture& picture) {
  const int height = static_cast<int>(picture.alpha.dim(0)), width = static_cast<int>(picture.alpha.dim(1));
  const auto image = [&](const Tensor& map, int channels) {
    if (!map) return Image();
    Image out(width, height, channels);
    if (!ctx.planning()) ctx.read(map, out.data.data());
    return out;
  };
  return {image(picture.colour, 3), image(picture.alpha, 1),  image(picture.depth, 1),
          image(picture.normal, 3), image(picture.median, 1), image(picture.distortion, 1)};
}

Picture render_picture(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options) {
  return download(ctx, render(ctx, scene, camera, options));
}

}  // namespace vsplat
