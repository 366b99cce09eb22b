#include "model/api/drawing.h"

#include <algorithm>
#include <cmath>

#include "model/render/supersample.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat::api {

Camera any_camera(long edge) {
  Camera out;
  out.width = out.height = static_cast<int>(edge);
  out.fx = out.fy = 1.5 * static_cast<double>(edge);
  out.cx = out.cy = 0.5 * static_cast<double>(edge);
  out.w2c(2, 3) = 2;
  return out;
}

const GaussianChunks& on_device(vsplat_device device, const std::shared_ptr<const Scene>& scene, double pixels) {
  if (device->scene_key.lock() != scene) {
    device->scene.reset();
    device->scene_key.reset();
    if (scene->gaussians.sh_degree > kDrawnDegree)
      warn("the scene's spherical harmonics have degree {}: they are drawn up to degree {}", scene->gaussians.sh_degree,
           kDrawnDegree);
    device->scene = place_on_device(device->context, scene->gaussians, pixels);
    device->scene_key = scene;
  }
  return *device->scene;
}

void plan_drawing(Context& planner, std::uint64_t count, int sh_degree, const Camera& camera, GaussianKind kind,
                  bool exact_tiles) {
  Gaussians unseen;  // a plan reads only their number
  unseen.count = count;
  unseen.sh_degree = sh_degree;
  unseen.kind = kind;
  RenderOptions guess;
  guess.exact_tiles = exact_tiles;
  guess.counts = [&](const Part& part) {
    const double share = part.tiles() / static_cast<double>(tiles_along(camera.width) * tiles_along(camera.height));
    VisibleCount seen;
    seen.intersections = static_cast<uint64_t>(std::ceil(guess.assumed_tiles * static_cast<double>(count) * share));
    seen.gaussians = std::min(count, seen.intersections);
    seen.largest_key = UINT32_MAX;
    return seen;
  };
  const GaussianChunks there = [&] {
    const Stage stage(planner, "scene");
    return place_on_device(planner, unseen, static_cast<double>(camera.width) * camera.height);
  }();
  (void)render(planner, there, camera, guess);
}

namespace {

bool antialiased(vsplat_antialias wanted, const Scene& scene) {
  switch (value_of(wanted)) {
    case VSPLAT_ANTIALIAS_SCENE:
      return scene.antialias;
    case VSPLAT_ANTIALIAS_ON:
      if (scene.gaussians.kind == GaussianKind::surfel)
        fail(Status::usage, "{} is for volumes, and the scene's Gaussians are surfels: they are drawn without it",
             Option::antialias);
      return true;
    case VSPLAT_ANTIALIAS_OFF:
      return false;
  }
  fail(Status::usage, "options.antialias is {}, not a value of vsplat_antialias", value_of(wanted));
}

}  // namespace

RenderOptions options_of(const vsplat_render_options& o, const Scene& scene) {
  if (!(o.near_plane >= 0)) fail(Status::usage, "options.near_plane is {}", o.near_plane);
  RenderOptions out;
  std::copy_n(o.background, 3, out.background.begin());
  for (const float v : out.background)
    if (!std::isfinite(v)) fail(Status::usage, "options.background is not finite");
  out.near = o.near_plane > 0 ? static_cast<float>(o.near_plane) : scene.near;
  out.mirror = scene.mirror;
  out.exact_tiles = o.exact_tiles != 0;
  out.antialias = antialiased(o.antialias, scene);
  if (o.supersample > static_cast<uint64_t>(kMostSamples))
    fail(Status::usage, "{} is {}: 1 to {} samples along a pixel's edge, or 0 for as many as the scene asks for",
         Option::supersample, o.supersample, kMostSamples);
  return out;
}

RenderOptions drawn_as(const vsplat_render_options& o, const Scene& scene, const Camera& view) {
  RenderOptions out = options_of(o, scene);
  if (o.supersample > 0)
    out.supersample = static_cast<int>(o.supersample);
  else if (scene.detail)
    out.supersample = samples_for(*scene.detail, view);
  return out;
}

double drawn_pixels(const Camera& view, const RenderOptions& how) {
  return static_cast<double>(view.width) * view.height * how.supersample * how.supersample;
}

RenderOptions derived_as(const vsplat_render_options& o, const Scene& scene) {
  if (o.supersample > 1)
    fail(Status::usage, "{} is {}: 0 or 1 is expected, since derivatives need a picture without supersampling",
         Option::supersample, o.supersample);
  return options_of(o, scene);
}

}  // namespace vsplat::api
