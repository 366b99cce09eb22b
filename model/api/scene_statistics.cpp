// Describing scenes.
#include "model/base/scene_statistics.h"

#include "model/api/scene.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

void copy_vector(const Eigen::Vector3d& from, double (&to)[3]) {
  for (Eigen::Index c = 0; c < 3; ++c) to[c] = from[c];
}

}  // namespace

vsplat_status vsplat_scene_get_statistics(vsplat_scene scene, vsplat_scene_statistics* out_statistics) {
  return guarded([&] {
    need(scene, "scene");
    require_output(out_statistics, "out_statistics");
    const std::shared_ptr<const Scene> now = scene->now();
    const SceneStatistics found = statistics_of(*now);
    const Gaussians& g = now->gaussians;
    vsplat_scene_statistics out = VSPLAT_SCENE_STATISTICS_INIT;
    out.count = g.count;
    out.not_finite = found.not_finite;
    out.transparent = found.transparent;
    out.invisible = found.invisible;
    out.huge = found.huge;
    out.distant = found.distant;
    copy_vector(found.low, out.low);
    copy_vector(found.high, out.high);
    copy_vector(found.low_1, out.low_1);
    copy_vector(found.high_99, out.high_99);
    out.median_opacity = found.median_opacity;
    out.median_size = found.median_size;
    out.largest_size = found.largest_size;
    const std::size_t floats =
        3 + static_cast<std::size_t>(scales_of(g.kind)) + 4 + 1 + 3 * g.sh_count();  // of each Gaussian
    out.bytes = g.count * floats * sizeof(float);
    give(out_statistics, out, "out_statistics");
  });
}
