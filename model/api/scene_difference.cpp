// Comparing the values of scenes.
#include "model/base/scene_difference.h"

#include "model/api/scene.h"

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_scene_get_difference(vsplat_scene scene, vsplat_scene other,
                                          vsplat_scene_difference* out_difference) {
  return guarded([&] {
    need(scene, "scene");
    need(other, "other");
    require_output(out_difference, "out_difference");
    const SceneDifference found = difference(*scene->now(), *other->now());
    vsplat_scene_difference out = VSPLAT_SCENE_DIFFERENCE_INIT;
    out.in_order = found.in_order;
    out.means = found.means.largest;
    out.means_rms = found.means.rms;
    out.scales = found.scales.largest;
    out.scales_rms = found.scales.rms;
    out.rotations = found.rotations.largest;
    out.rotations_rms = found.rotations.rms;
    out.opacities = found.opacities.largest;
    out.opacities_rms = found.opacities.rms;
    out.sh = found.sh.largest;
    out.sh_rms = found.sh.rms;
    give(out_difference, out, "out_difference");
  });
}
