// Meshes of scenes for C++, see vsplat/mesh.h. Part of vsplat.hpp, which includes this file.
#include <vsplat/vsplat.hpp>  // before the guard: other parts of vsplat.hpp use these

#ifndef VSPLAT_MESH_HPP
#define VSPLAT_MESH_HPP

#include <string>

namespace vsplat {
inline namespace cxx {

inline Mesh mesh_from_scene(const Device& device, const Scene& scene, const vsplat_scene_mesh_options& options) {
  vsplat_mesh out = nullptr;
  check(vsplat_mesh_from_scene(device.get(), scene.get(), &options, &out));
  return Mesh(out);
}
inline Mesh mesh_from_scene(const Device& device, const Scene& scene, vsplat_scene_mesh_options options,
                            const Progress& progress) {
  detail::ProgressCall call(progress);
  options = call.of(options);
  vsplat_mesh out = nullptr;
  call.check(vsplat_mesh_from_scene(device.get(), scene.get(), &options, &out));
  return Mesh(out);
}

inline void save(const Mesh& mesh, const std::string& path) { check(vsplat_mesh_save(mesh.get(), path.c_str())); }

// `arrays`: the caller's memory.
inline void get_arrays(const Mesh& mesh, const vsplat_mesh_arrays& arrays) {
  check(vsplat_mesh_get_arrays(mesh.get(), &arrays));
}

}  // namespace cxx
}  // namespace vsplat

#endif
