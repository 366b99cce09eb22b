// Reducing a scene to its most visible Gaussians.
#include "model/render/visibility.h"

#include <vector>

#include "model/api/cameras.h"
#include "model/api/device.h"
#include "model/api/scene.h"
#include "model/base/scene_edit.h"
#include "model/views/orbit.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

constexpr Ring kSeenFrom[] = {{-30, 8}, {5, 8}, {40, 8}};
constexpr int kSeenPixels = 512;

std::vector<Camera> cameras_of(const vsplat_scene_keep_visible_options& o) {
  if (!o.cameras && o.num_cameras)
    fail(Status::usage, "options.cameras is null, but options.num_cameras is {}", o.num_cameras);
  if (o.cameras && !o.num_cameras) fail(Status::usage, "options.num_cameras is 0: at least one camera expected");
  std::vector<Camera> out;
  for (size_t i = 0; i < o.num_cameras; ++i) out.push_back(camera_of(o.cameras[i], "options.cameras"));
  return out;
}

}  // namespace

vsplat_status vsplat_scene_keep_visible(vsplat_device device, vsplat_scene scene,
                                        const vsplat_scene_keep_visible_options* options) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    const vsplat_scene_keep_visible_options o = taken(options, VSPLAT_SCENE_KEEP_VISIBLE_OPTIONS_INIT, "options");
    const std::shared_ptr<const Scene> now = scene->now();
    std::vector<Camera> cameras = cameras_of(o);
    if (o.max_gaussians == 0 || now->gaussians.count <= o.max_gaussians) return;
    if (cameras.empty()) cameras = rings_about_scene(*now, kSeenFrom, kSeenPixels, kSeenPixels);
    for (Camera& camera : cameras) camera = in_frame(*now, camera);
    const auto begin = [&](std::size_t i) {
      const double share = static_cast<double>(i) / static_cast<double>(cameras.size());
      if (o.progress && !o.progress(o.user, "visibility", share))
        fail(Status::cancelled, "stopped before picture {} of {}", i + 1, cameras.size());
    };
    const std::vector<float> weights = retry_with_memory_freed(
        device, nullptr, [&] { return blending_weights(device->context, *now, cameras, begin); });
    const std::vector<bool> stays = heaviest(weights, static_cast<std::size_t>(o.max_gaussians));
    auto made = std::make_shared<Scene>(*now);
    keep(made->gaussians, [&](std::size_t k) { return stays[k]; });
    scene->become(std::move(made));
  });
}
