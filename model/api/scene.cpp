#include "model/api/scene.h"

#include <algorithm>

#include "model/io/ply.h"
#include "model/io/selection_file.h"

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_scene_load(const char* path, vsplat_scene* out_scene) {
  return guarded([&] {
    need(path, "path");
    need(out_scene, "out_scene");
    auto scene = std::make_unique<vsplat_scene_impl>();
    scene->scene = std::make_shared<const Scene>(read_ply(path));
    *out_scene = scene.release();
  });
}

vsplat_status vsplat_scene_save(vsplat_scene scene, const char* path) {
  return guarded([&] {
    need(scene, "scene");
    need(path, "path");
    write_ply(path, *scene->scene);
  });
}

void vsplat_scene_retain(vsplat_scene scene) { retain(scene); }
void vsplat_scene_release(vsplat_scene scene) { release(scene); }

vsplat_status vsplat_scene_get_info(vsplat_scene scene, vsplat_scene_info* out_info) {
  return guarded([&] {
    need(scene, "scene");
    const Scene& s = *scene->scene;
    vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
    info.count = s.gaussians.count;
    info.sh_degree = s.gaussians.sh_degree;
    info.near_plane = static_cast<double>(s.near);
    info.has_mirror = s.mirror.has_value();
    for (size_t i = 0; s.mirror && i < 3; ++i) info.mirror[i] = static_cast<double>((*s.mirror)[i]);
    give(out_info, info, "out_info");
  });
}

vsplat_status vsplat_scene_get_gaussians(vsplat_scene scene, const vsplat_gaussians* arrays) {
  return guarded([&] {
    need(scene, "scene");
    need(arrays, "arrays");
    const vsplat_gaussians a = taken(arrays, VSPLAT_GAUSSIANS_INIT, "arrays");
    const Gaussians& g = scene->scene->gaussians;
    if (a.capacity < g.count)
      fail(Status::usage, "arrays.capacity is {}: the scene has {} Gaussians", a.capacity, g.count);
    const auto copy = [](const std::vector<float>& from, float* to) {
      if (to) std::copy(from.begin(), from.end(), to);
    };
    copy(g.means, a.means);
    copy(g.scales, a.scales);
    copy(g.quats, a.rotations);
    copy(g.opacities, a.opacities);
    copy(g.sh, a.sh);
  });
}

vsplat_status vsplat_scene_get_selection(vsplat_scene scene, int32_t* out_voxels, size_t capacity, size_t* out_count) {
  return guarded([&] {
    need(scene, "scene");
    need(out_count, "out_count");
    need_array(out_voxels, capacity, "out_voxels");
    const std::vector<int>& selected = scene->selected;
    std::copy_n(selected.begin(), std::min(capacity, selected.size()), out_voxels);
    *out_count = selected.size();
  });
}

vsplat_status vsplat_scene_save_selection(vsplat_scene scene, const char* path) {
  return guarded([&] {
    need(scene, "scene");
    need(path, "path");
    write_selection(path, scene->selected);
  });
}
