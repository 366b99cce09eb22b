#include "model/api/drawing.h"

#include <algorithm>
#include <cmath>

#include "runtime/fail.h"

namespace vsplat::api {

const GaussianChunks& on_device(vsplat_device device, const std::shared_ptr<const Scene>& scene, double pixels) {
  if (device->scene_key.lock() != scene) {
    device->scene.reset();
    device->scene_key.reset();
    device->scene = place_on_device(device->context, scene->gaussians, pixels);
    device->scene_key = scene;
  }
  return *device->scene;
}

RenderOptions options_of(const vsplat_render_options& o, const Scene& scene) {
  if (!(o.near_plane >= 0)) fail(Status::usage, "options.near_plane is {}", o.near_plane);
  RenderOptions out;
  std::copy_n(o.background, 3, out.background.begin());
  for (const float v : out.background)
    if (!std::isfinite(v)) fail(Status::usage, "options.background is not finite");
  out.near = o.near_plane > 0 ? static_cast<float>(o.near_plane) : scene.near;
  out.mirror = scene.mirror;
  out.exact_tiles = o.exact_tiles != 0;
  return out;
}

}  // namespace vsplat::api
