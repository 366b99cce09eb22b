// Drawing a scene, and what it needs.
#include "model/splat/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "model/api/cameras.h"
#include "model/api/drawing.h"
#include "model/api/pixels.h"
#include "model/api/plan.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

// Into the caller's memory, or into `own` where he has none for it.
const float* read(Context& ctx, const Tensor& from, float* to, bool wanted, std::vector<float>& own) {
  if (!to && wanted) {
    own.resize(static_cast<std::size_t>(from.count()));
    to = own.data();
  }
  if (to) ctx.read(from, to);
  return to;
}

vsplat_picture room_of(const vsplat_picture& picture, const std::string& what) {
  return taken(&picture, VSPLAT_PICTURE_INIT, what.c_str());
}

// Of a picture's planes, where the caller gets them.
double host_bytes(double pixels) {
  constexpr double planes = 3 + 1 + 1;
  return planes * sizeof(float) * pixels;
}

struct Shot {
  Camera camera;
  vsplat_picture picture;
  CallersPixels pixels;

  Shot(const Camera& seen_from, const vsplat_picture& into, const std::string& what)
      : camera(seen_from), picture(room_of(into, what)), pixels(picture, camera.width, what) {}
};

// Everything that can be wrong with the request is found before the first is drawn.
void draw(vsplat_device device, vsplat_scene scene, const std::vector<Shot>& shots,
          const vsplat_render_options* options) {
  need(device, "device");
  need(scene, "scene");
  const vsplat_render_options o = taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options");
  std::vector<Camera> views;
  std::vector<RenderOptions> how;
  double most = 0;
  for (const Shot& shot : shots) {
    const uint64_t pixels = static_cast<uint64_t>(shot.camera.width) * static_cast<uint64_t>(shot.camera.height);
    if (shot.picture.capacity < pixels)
      fail(Status::usage, "picture.capacity is {} pixels: the camera's picture has {}", shot.picture.capacity, pixels);
    views.push_back(in_frame(*scene->scene, shot.camera));
    how.push_back(drawn_as(o, *scene->scene, views.back()));
    most = std::max(most, drawn_pixels(views.back(), how.back()));
  }
  std::vector<float> colour, alpha;
  for (size_t i = 0; i < shots.size(); ++i) {
    if (o.progress && !o.progress(o.user, "splat", static_cast<double>(i) / static_cast<double>(shots.size())))
      fail(Status::cancelled, "stopped with {} of {} pictures drawn", i, shots.size());
    const GaussianChunks& there = on_device(device, scene->scene, most);
    Context& ctx = device->context;
    const DevicePicture drawn = render(ctx, there, views[i], how[i]);
    ctx.finish();
    const Shot& shot = shots[i];
    const float* colour_read = read(ctx, drawn.colour, shot.picture.colour, shot.pixels.wanted(), colour);
    const float* alpha_read = read(ctx, drawn.alpha, shot.picture.alpha, shot.pixels.wants_alpha(), alpha);
    if (shot.picture.depth) ctx.read(drawn.depth, shot.picture.depth);
    if (shot.pixels.wanted()) shot.pixels.write(colour_read, alpha_read, shot.camera.height, o.background);
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
    need_array(cameras, count, "cameras");
    need_array(pictures, count, "pictures");
    std::vector<Shot> shots;
    for (size_t i = 0; i < count; ++i)
      shots.emplace_back(camera_of(element(cameras, i), fmt::format("camera {}", i).c_str()), element(pictures, i),
                         fmt::format("picture {}", i));
    draw(device, scene, shots, options);
  });
}

vsplat_status vsplat_plan_scene(vsplat_device device, vsplat_scene scene, const vsplat_camera* cameras, size_t count,
                                const vsplat_render_options* options, vsplat_plan* out_plan) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need_array(cameras, count, "cameras");
    need_room(out_plan, "out_plan");
    const vsplat_render_options o = taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options");
    std::vector<Camera> views;
    std::vector<RenderOptions> how;
    double pixels = 0, most = 0;  // of what is read back, and of what is drawn
    for (size_t i = 0; i < count; ++i) {
      views.push_back(in_frame(*scene->scene, camera_of(element(cameras, i), fmt::format("camera {}", i).c_str())));
      how.push_back(drawn_as(o, *scene->scene, views.back()));
      pixels = std::max(pixels, static_cast<double>(views.back().width) * views.back().height);
      most = std::max(most, drawn_pixels(views.back(), how.back()));
    }
    const Gaussians& g = scene->scene->gaussians;
    const std::unique_ptr<Context> planner = device->context.planner();
    const bool fits = fits_within([&] {
      const GaussianChunks planned = [&] {
        const Stage stage(*planner, "scene");
        return place_on_device(*planner, g, most);
      }();
      const GaussianChunks& there = on_device(device, scene->scene, most);
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
    need_room(out_plan, "out_plan");
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
    if (!fits) {  // what it would take all the same
      planner = device->context.planner(false);
      (void)fits_within(plan);
    }
    vsplat_plan out = plan_of(*planner, planner->stage_memory(), planner->memory().peak(), fits, host_bytes(pixels));
    out.limit = device->context.memory().limits().total;
    give(out_plan, out, "out_plan");
  });
}
