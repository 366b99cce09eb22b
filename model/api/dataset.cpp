// Meshes, and objects of data sets made from them.
#include <nlohmann/json.hpp>
#include <set>

#include "model/api/handle.h"
#include "model/data/mesh_file.h"
#include "model/data/object_folder.h"
#include "model/data/object_names.h"
#include "model/data/solids.h"

struct vsplat_mesh_impl : vsplat::api::Counted {
  explicit vsplat_mesh_impl(vsplat::Mesh from) : mesh(std::move(from)) {}
  const vsplat::Mesh mesh;
};

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_mesh_load(const char* path, const char* texture, vsplat_mesh* out_mesh) {
  return guarded([&] {
    need(path, "path");
    need(out_mesh, "out_mesh");
    *out_mesh = std::make_unique<vsplat_mesh_impl>(load_mesh(path, texture ? texture : "")).release();
  });
}

vsplat_status vsplat_mesh_procedural(uint64_t seed, uint32_t index, vsplat_mesh* out_mesh) {
  return guarded([&] {
    need(out_mesh, "out_mesh");
    *out_mesh = std::make_unique<vsplat_mesh_impl>(random_solid(seed, index)).release();
  });
}

void vsplat_mesh_retain(vsplat_mesh mesh) { retain(mesh); }
void vsplat_mesh_release(vsplat_mesh mesh) { release(mesh); }

vsplat_status vsplat_mesh_get_info(vsplat_mesh mesh, vsplat_mesh_info* out_info) {
  return guarded([&] {
    need(mesh, "mesh");
    std::set<const Texture*> textures;
    for (const Material& material : mesh->mesh.palette)
      if (material.texture) textures.insert(material.texture.get());
    vsplat_mesh_info info = VSPLAT_MESH_INFO_INIT;
    info.triangles = mesh->mesh.triangles();
    info.textures = textures.size();
    give(out_info, info, "out_info");
  });
}

vsplat_status vsplat_mesh_write_views(vsplat_mesh mesh, const vsplat_mesh_views_options* options, const char* folder) {
  return guarded([&] {
    need(mesh, "mesh");
    need(folder, "folder");
    const vsplat_mesh_views_options o = taken(options, VSPLAT_MESH_VIEWS_OPTIONS_INIT, "options");
    ObjectOptions object;
    object.views = o.views;
    object.size = o.pixels;
    object.seed = o.seed;
    object.object = o.index;
    if (o.progress) object.go = [&o](double done) { return o.progress(o.user, "pictures", done) != 0; };
    write_object(folder, mesh->mesh, object);
  });
}

vsplat_status vsplat_object_names(const char* const* paths, size_t num_paths, char** out_text) {
  return guarded([&] {
    need(out_text, "out_text");
    need_array(paths, num_paths, "paths");
    std::vector<std::string> files;
    for (std::size_t i = 0; i < num_paths; ++i) {
      need(paths[i], "a path");
      files.emplace_back(paths[i]);
    }
    const nlohmann::json names = object_names(files);
    *out_text = new_text(names.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  });
}
