// Converting scenes from one kind of Gaussians to another.
#include "model/api/scene.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_scene_surfels_to_gaussians(vsplat_scene scene, double thickness, vsplat_scene* out_scene) {
  return guarded([&] {
    need(scene, "scene");
    need(out_scene, "out_scene");
    if (!(thickness > 0 && thickness <= 1))
      fail(Status::usage,
           "thickness is {}: a share of a surfel's smaller standard deviation, above 0 and at most 1, is expected",
           thickness);
    const std::shared_ptr<const Scene> from = scene->now();
    if (from->gaussians.kind != GaussianKind::surfel)
      fail(Status::usage, "the scene's Gaussians already have three scales each: a scene of surfels is expected");
    auto made = std::make_shared<Scene>(*from);
    made->gaussians = thickened(from->gaussians, thickness);
    auto out = std::make_unique<vsplat_scene_impl>();
    out->become(std::move(made));
    out->selected = scene->selected;
    *out_scene = out.release();
  });
}
