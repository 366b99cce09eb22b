#include "model/render/render_backward.h"

#include <algorithm>

#include "model/ops/fit/splat_split.h"
#include "model/render/reserve.h"

namespace vsplat {

SceneGradient zero_gradient(Context& ctx, const GaussianChunks& scene) {
  const auto make = [&](Context& c) {
    SceneGradient out;
    for (long i = 0; i < scene.chunks(); ++i)
      out.push_back(zero_gradients(c, scene.size_of(i), scene.sh_degree, scene.kind));
    return out;
  };
  reserve_for(ctx, [&](Context& c) { make(c); });
  return make(ctx);
}

Gaussians download(Context& ctx, const SceneGradient& gradient, int sh_degree) {
  Gaussians out;
  out.sh_degree = sh_degree;
  if (!gradient.empty() && gradient.front().scales.dim(1) == scales_of(GaussianKind::surfel))
    out.kind = GaussianKind::surfel;
  const auto append = [&](std::vector<float>& to, const Tensor& from) {
    const auto at = to.size();
    to.resize(at + static_cast<std::size_t>(from.count()));
    if (from.count()) ctx.read(from, to.data() + at);
  };
  for (const GaussianGradients& g : gradient) {
    append(out.means, g.means);
    append(out.scales, g.scales);
    append(out.quats, g.quats);
    append(out.opacities, g.opacities);
    append(out.sh, g.sh);
  }
  out.count = out.opacities.size();
  return out;
}

namespace {

// The gradients of one part of the picture, which has been drawn. `pose_gradients`: those of project_backward().
void part_backward(Context& ctx, const GaussianChunks& scene, const RenderOptions& options, const Part& part,
                   const Projected& projected, const Binned& binned, const DevicePicture& picture,
                   const PictureGradient& gradient, const SceneGradient& out, const Tensor& pose_gradients,
                   const PixelSums& sums) {
  const bool surfels = scene.kind == GaussianKind::surfel, mirrored = options.mirror.has_value();
  IntersectionGradients rows;
  {
    const Stage stage(ctx, "rasterize");
    rows = surfels ? rasterize_surfels_backward(ctx, {projected, binned, part, options.background, picture, gradient,
                                                      options.near, options.revision})
                   : rasterize_backward(ctx, {projected, binned, part, options.background, picture, gradient,
                                              Pulls::none, static_cast<bool>(sums.to)});
    if (sums.to) {
      SplatScores a{projected, binned.offsets, rows, sums.to};
      if (sums.wide_first) a.most_pixels = static_cast<double>(picture.alpha.count()) / 2;
      splat_scores(ctx, a);
    }
  }
  const Stage stage(ctx, "project");
  for (long i = 0; i < scene.chunks(); ++i) {
    const DeviceGaussians chunk = scene.get(ctx, i);
    const GaussianGradients& to = out.at(static_cast<std::size_t>(i));
    const long base = i * scene.chunk;
    if (surfels)
      project_surfels_backward(ctx, {chunk, base, projected.camera, 0, mirrored, projected, binned.offsets, rows, to,
                                     pose_gradients, options.revision});
    else
      project_backward(ctx, {chunk, base, projected.camera, 0, mirrored, projected, binned.offsets, rows, to,
                             pose_gradients, options.antialias});
  }
}

// Draws `picture` part by part, and adds each part's derivatives to `out`.
void differentiate_parts(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                         const DevicePicture& picture, const PictureGradient& gradient, const SceneGradient& out,
                         std::array<double, 6>* pose, const PixelSums& sums) {
  std::vector<Tensor> poses;  // one per part
  for_each_part(ctx, scene, camera, options, true,
                [&](Context& c, const Part& part, const Projected& projected, const Binned& binned) {
                  draw_part(c, scene, options, part, projected, binned, picture);
                  const Tensor pose_gradients =
                      pose ? c.tensor({projected.ids.dim(0), 6}, Type::f32, "pose_gradients") : Tensor();
                  part_backward(c, scene, options, part, projected, binned, picture, gradient, out, pose_gradients,
                                sums);
                  if (!pose) return;
                  const Tensor sum = sum_pose_gradients(c, pose_gradients);
                  if (!c.planning()) poses.push_back(sum);
                });
  if (!pose) return;
  pose->fill(0);
  for (const Tensor& part : poses) {
    const auto values = ctx.read<float>(part);
    for (std::size_t i = 0; i < 6; ++i) (*pose)[i] += static_cast<double>(values[i]);
  }
}

}  // namespace

void render_backward(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                     const PictureGradient& gradient, const SceneGradient& out, std::array<double, 6>* pose,
                     const PixelSums& sums) {
  const SurfelMaps maps{static_cast<bool>(gradient.normal), false, static_cast<bool>(gradient.distortion)};
  const Stage stage(ctx, "splat");
  const DevicePicture picture = reserved_picture(ctx, scene, camera, maps);
  differentiate_parts(ctx, scene, camera, options, picture, gradient, out, pose, sums);
}

DrawnPicture render_with_backward(Context& ctx, const GaussianChunks& scene, const Camera& camera,
                                  const RenderOptions& options, const PictureLossWork& loss, const SceneGradient& out,
                                  std::array<double, 6>* pose, const PixelSums& sums) {
  const Stage stage(ctx, "splat");
  const DevicePicture picture = reserved_picture(ctx, scene, camera, options.maps);
  DrawnPicture drawn{picture};
  bool done = false;
  for_each_part(ctx, scene, camera, options, true,
                [&](Context& c, const Part& part, const Projected& projected, const Binned& binned) {
                  draw_part(c, scene, options, part, projected, binned, picture);
                  if (&c == &ctx) drawn.intersections += static_cast<std::uint64_t>(binned.ids.count());
                  if (part.tiles() != tiles_along(camera.width) * tiles_along(camera.height)) return;
                  const PictureGradient gradient = loss(c, picture);
                  const Tensor pose_gradients =
                      pose ? c.tensor({projected.ids.dim(0), 6}, Type::f32, "pose_gradients") : Tensor();
                  part_backward(c, scene, options, part, projected, binned, picture, gradient, out, pose_gradients,
                                sums);
                  const Tensor sum = pose ? sum_pose_gradients(c, pose_gradients) : Tensor();
                  if (pose && &c == &ctx && !ctx.planning()) {
                    const auto values = ctx.read<float>(sum);
                    std::copy(values.begin(), values.end(), pose->begin());
                  }
                  if (&c == &ctx) done = true;  // not on the plan, which may not fit
                });
  if (done) return drawn;
  // With several parts, the loss needs the whole picture, which is complete only now. Its memory is planned like that
  // of the parts: what it took piece by piece would not be left in one piece for them.
  reserve_for(ctx, [&](Context& c) { loss(c, picture); });
  const PictureGradient gradient = loss(ctx, picture);
  differentiate_parts(ctx, scene, camera, options, picture, gradient, out, pose, sums);
  return drawn;
}

void screen_pulls(Context& ctx, const DeviceGaussians& scene, const Camera& camera, const RenderOptions& options,
                  const PictureLossWork& loss, Pulls pulls, const Tensor& out) {
  const Stage stage(ctx, "splat");
  const GaussianChunks chunks(scene);
  const DevicePicture picture = reserved_picture(ctx, chunks, camera, {});
  const auto pull = [&](Context& c, const Part& part, const Projected& projected, const Binned& binned,
                        const PictureGradient& gradient) {
    IntersectionGradients rows;
    {
      const Stage rasterizing(c, "rasterize");
      rows = rasterize_backward(c, {projected, binned, part, options.background, picture, gradient, pulls});
    }
    const Stage projecting(c, "project");
    project_pulls(c, {projected, binned.offsets, rows, camera.width / 2.0, camera.height / 2.0, out});
  };
  bool done = false;
  for_each_part(ctx, chunks, camera, options, true,
                [&](Context& c, const Part& part, const Projected& projected, const Binned& binned) {
                  draw_part(c, chunks, options, part, projected, binned, picture);
                  if (part.tiles() != tiles_along(camera.width) * tiles_along(camera.height)) return;
                  pull(c, part, projected, binned, loss(c, picture));
                  if (&c == &ctx) done = true;  // not on the plan, which may not fit
                });
  if (done) return;
  const PictureGradient gradient = loss(ctx, picture);  // needs the whole picture
  for_each_part(ctx, chunks, camera, options, true,
                [&](Context& c, const Part& part, const Projected& projected, const Binned& binned) {
                  pull(c, part, projected, binned, gradient);
                });
}

}  // namespace vsplat
