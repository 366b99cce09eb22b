// Scenes as a whole, for C++: filtered, turned, reduced, described and compared. Part of vsplat.hpp, which includes
// this file.
#ifndef VSPLAT_SCENE_EDIT_HPP
#define VSPLAT_SCENE_EDIT_HPP

#include <string>
#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

// Filters, turns, scales and moves the scene, and every other handle to it; see vsplat_scene_edit.
inline vsplat_scene_edit_result edit(const Scene& scene, const vsplat_scene_edit_options& options) {
  vsplat_scene_edit_result out = VSPLAT_SCENE_EDIT_RESULT_INIT;
  check(vsplat_scene_edit(scene.get(), &options, &out));
  return out;
}

// Keeps the most visible Gaussians of the scene.
inline void keep_visible(const Device& device, const Scene& scene, const vsplat_scene_keep_visible_options& options) {
  check(vsplat_scene_keep_visible(device.get(), scene.get(), &options));
}
inline void keep_visible(const Device& device, const Scene& scene, vsplat_scene_keep_visible_options options,
                         const Progress& progress) {
  detail::ProgressCall call(progress);
  options = call.of(options);
  call.check(vsplat_scene_keep_visible(device.get(), scene.get(), &options));
}

inline vsplat_scene_file describe_scene_file(const std::string& path) {
  vsplat_scene_file out = VSPLAT_SCENE_FILE_INIT;
  check(vsplat_scene_file_describe(path.c_str(), &out));
  return out;
}

inline vsplat_scene_statistics statistics(const Scene& scene) {
  vsplat_scene_statistics out = VSPLAT_SCENE_STATISTICS_INIT;
  check(vsplat_scene_get_statistics(scene.get(), &out));
  return out;
}

// How far the values of two scenes of the same Gaussians are apart.
inline vsplat_scene_difference difference(const Scene& scene, const Scene& other) {
  vsplat_scene_difference out = VSPLAT_SCENE_DIFFERENCE_INIT;
  check(vsplat_scene_get_difference(scene.get(), other.get(), &out));
  return out;
}

}  // namespace cxx
}  // namespace vsplat

#endif
