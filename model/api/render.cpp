// Drawing a scene, and the memory it needs.
#include "model/render/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "model/api/cameras.h"
#include "model/api/drawing.h"
#include "model/api/pixels.h"
#include "model/api/plan.h"
#include "model/render/geometry.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

// Reads to the caller's memory, or to `own` if the caller gave none and it is wanted.
const float* read(Context& ctx, const Tensor& from, float* to, bool wanted, std::vector<float>& own) {
  if (!to && wanted) {
    own.resize(static_cast<std::size_t>(from.count()));
    to = own.data();
  }
  if (to) ctx.read(from, to);
  return to;
}

vsplat_picture output_of(const vsplat_picture& picture, const std::string& what) {
  return taken(&picture, VSPLAT_PICTURE_INIT, what.c_str());
}

// Host memory of a picture's planes.
double host_bytes(double pixels) {
  constexpr double planes = 3 + 1 + 1;
  return planes * sizeof(float) * pixels;
}

struct Shot {
  std::string what;
  bool wants_any;
  Camera camera;
  vsplat_picture picture;
  CallersPixels pixels;

  Shot(const Camera& seen_from, const vsplat_picture& into, const std::string& name)
      : what(name),
        wants_any(false),
        camera(seen_from),
        picture(output_of(into, name)),
        pixels(picture, camera.width, camera.height, name) {
    const bool arrays = picture.colour || picture.alpha || picture.depth || picture.expected || wants_geometry();
    wants_any = arrays || pixels.wanted();
    if (picture.capacity < count() && (arrays || picture.data_bytes == 0))
      fail(Status::usage, "{}.capacity is {} pixels: the camera's picture has {}", what, picture.capacity, count());
  }

  std::size_t count() const { return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height); }
  bool wants_geometry() const { return picture.median || picture.normal || picture.ids; }
  // Adds the memory that is written.
  void add_to(Outputs& outputs) const {
    const std::size_t bytes = count() * sizeof(float);
    outputs.add(picture.colour, 3 * bytes, what + ".colour");
    outputs.add(picture.alpha, bytes, what + ".alpha");
    outputs.add(picture.depth, bytes, what + ".depth");
    outputs.add(picture.expected, bytes, what + ".expected");
    outputs.add(picture.median, bytes, what + ".median");
    outputs.add(picture.normal, 3 * bytes, what + ".normal");
    outputs.add(picture.ids, bytes, what + ".ids");
    pixels.add_to(outputs, what + ".data");
  }
};

void copy_to(const std::vector<float>& from, float* to) {
  if (to) std::copy(from.begin(), from.end(), to);
}

// Draws median depths, normals and ids.
void draw_geometry(Context& ctx, const GaussianChunks& there, const Scene& scene, const Shot& shot, const Camera& view,
                   RenderOptions how) {
  const vsplat_picture& p = shot.picture;
  how.supersample = 1;
  if (scene.gaussians.kind == GaussianKind::surfel) {
    how.maps = {p.normal != nullptr, p.median != nullptr, false};
    const Picture drawn = render_picture(ctx, there, view, how);
    copy_to(drawn.normal.data, p.normal);
    copy_to(drawn.median.data, p.median);
    return;
  }
  if (p.median || p.ids) {
    const Picks picks = pick(ctx, there, view, how);
    copy_to(picks.median, p.median);
    if (p.ids) std::copy(picks.ids.begin(), picks.ids.end(), p.ids);
  }
  if (!p.normal) return;
  how.background = {0, 0, 0};
  const Gaussians coloured = coloured_by_normals(scene.gaussians, view);
  const Picture drawn = render_picture(ctx, place_on_device(ctx, coloured, drawn_pixels(view, how)), view, how);
  for (std::size_t i = 0; i < drawn.colour.data.size(); ++i)
    p.normal[i] = 2 * drawn.colour.data[i] - drawn.alpha.data[i / 3];
}

// Checks the whole request before the first picture is drawn.
void draw(vsplat_device device, vsplat_scene scene, const std::vector<Shot>& shots,
          const vsplat_render_options* options) {
  need(device, "device");
  need(scene, "scene");
  const vsplat_render_options o = taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options");
  const std::shared_ptr<const Scene> drawn_scene = scene->now();
  std::vector<Camera> views;
  std::vector<RenderOptions> how;
  double most = 0;
  if (!shots.empty() && std::none_of(shots.begin(), shots.end(), [](const Shot& shot) { return shot.wants_any; }))
    fail(Status::usage, "{}: colour, alpha, depth, data and the others are all null: there is nothing to draw into",
         shots.front().what);
  for (const Shot& shot : shots) {
    Outputs outputs;
    shot.add_to(outputs);
    outputs.refuse_shared();
    if (shot.picture.ids && drawn_scene->gaussians.kind == GaussianKind::surfel)
      fail(Status::usage, "{}.ids: the scene's Gaussians are surfels, but ids exist only for volumes", shot.what);
    views.push_back(in_frame(*drawn_scene, shot.camera));
    how.push_back(drawn_as(o, *drawn_scene, views.back()));
    most = std::max(most, drawn_pixels(views.back(), how.back()));
  }
  std::vector<float> colour, alpha, depth;
  for (size_t i = 0; i < shots.size(); ++i) {
    if (o.progress && !o.progress(o.user, "splat", static_cast<double>(i) / static_cast<double>(shots.size())))
      fail(Status::cancelled, "stopped with {} of {} pictures drawn", i, shots.size());
    const GaussianChunks& there = on_device(device, drawn_scene, most);
    Context& ctx = device->context;
    const DevicePicture drawn = render(ctx, there, views[i], how[i]);
    ctx.finish();
    const Shot& shot = shots[i];
    const float* colour_read = read(ctx, drawn.colour, shot.picture.colour, shot.pixels.wanted(), colour);
    float* const expected = shot.picture.expected;
    const float* alpha_read = read(ctx, drawn.alpha, shot.picture.alpha, shot.pixels.wants_alpha() || expected, alpha);
    const float* depth_read = read(ctx, drawn.depth, shot.picture.depth, expected, depth);
    for (std::size_t k = 0; expected && k < shot.count(); ++k)
      expected[k] = alpha_read[k] > 0 ? depth_read[k] / alpha_read[k] : 0;
    if (shot.wants_geometry()) draw_geometry(ctx, there, *drawn_scene, shot, views[i], how[i]);
    if (shot.pixels.wanted()) shot.pixels.write(colour_read, alpha_read, o.background);
  }
}

}  // namespace

vsplat_status vsplat_render(vsplat_device device, vsplat_scene scene, const vsplat_camera* camera,
                            const vsplat_render_options* options, const vsplat_picture* picture) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need(camera, "camera");
    need(picture, "picture");
    draw(device, scene, {Shot(camera_of(*camera, "camera"), *picture, "picture")}, options);
  });
}

vsplat_status vsplat_render_views(vsplat_device device, vsplat_scene scene, const vsplat_camera* cameras, size_t count,
                                  const vsplat_render_options* options, const vsplat_picture* pictures) {
  return guarded([&] {
    const DeviceUse use(device);
    need_structs(cameras, count, "cameras");
    need_structs(pictures, count, "pictures");
    std::vector<Shot> shots;
    for (size_t i = 0; i < count; ++i)
      shots.emplace_back(camera_of(element(cameras, i, "cameras"), fmt::format("camera {}", i).c_str()),
                         element(pictures, i, "pictures"), fmt::format("picture {}", i));
    draw(device, scene, shots, options);
  });
}

vsplat_status vsplat_plan_scene(vsplat_device device, vsplat_scene scene, const vsplat_camera* cameras, size_t count,
                                const vsplat_render_options* options, vsplat_plan* out_plan) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need_structs(cameras, count, "cameras");
    require_output(out_plan, "out_plan");
    const vsplat_render_options o = taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options");
    std::vector<Camera> views;
    std::vector<RenderOptions> how;
    const std::shared_ptr<const Scene> planned_scene = scene->now();
    double pixels = 0, most = 0;  // read back, and drawn
    for (size_t i = 0; i < count; ++i) {
      views.push_back(
          in_frame(*planned_scene, camera_of(element(cameras, i, "cameras"), fmt::format("camera {}", i).c_str())));
      how.push_back(drawn_as(o, *planned_scene, views.back()));
      pixels = std::max(pixels, static_cast<double>(views.back().width) * views.back().height);
      most = std::max(most, drawn_pixels(views.back(), how.back()));
    }
    const Gaussians& g = planned_scene->gaussians;
    const std::unique_ptr<Context> planner = device->context.planner();
    const bool fits = fits_within([&] {
      const GaussianChunks planned = [&] {
        const Stage stage(*planner, "scene");
        return place_on_device(*planner, g, most);
      }();
      const GaussianChunks& there = on_device(device, planned_scene, most);
      for (size_t i = 0; i < count; ++i) {
        if (o.progress && !o.progress(o.user, "splat", static_cast<double>(i) / static_cast<double>(count)))
          fail(Status::cancelled, "stopped before all was counted");
        plan_render(device->context, there, *planner, planned, views[i], how[i]);
      }
    });
    give(out_plan, plan_of(*planner, planner->stage_memory(), planner->memory().peak(), fits, host_bytes(pixels)),
         "out_plan");
  });
}

vsplat_status vsplat_plan_render(vsplat_device device, uint64_t count, int32_t sh_degree, int32_t width, int32_t height,
                                 vsplat_plan* out_plan) {
  return guarded([&] {
    const DeviceUse use(device);
    require_output(out_plan, "out_plan");
    if (sh_degree < 0 || sh_degree > 3) fail(Status::usage, "sh_degree is {}: 0 to 3 expected", sh_degree);
    if (count > INT32_MAX) fail(Status::usage, "count is {}: at most {} Gaussians", count, INT32_MAX);
    Camera camera;
    vsplat_camera any = VSPLAT_CAMERA_INIT;
    any.width = width, any.height = height, any.fx = any.fy = 1;
    camera = camera_of(any, "the picture");
    const double pixels = static_cast<double>(width) * height;
    std::unique_ptr<Context> planner = device->context.planner();
    const auto plan = [&] { plan_drawing(*planner, count, sh_degree, camera); };
    const bool fits = fits_within(plan);
    if (!fits) {  // plan again without limits, for the memory it would take
      planner = device->context.planner(false);
      (void)fits_within(plan);
    }
    vsplat_plan out = plan_of(*planner, planner->stage_memory(), planner->memory().peak(), fits, host_bytes(pixels));
    out.limit = device->context.memory().limits().total;
    give(out_plan, out, "out_plan");
  });
}
