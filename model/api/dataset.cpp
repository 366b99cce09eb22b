// Meshes, the data set objects rendered from them, and reading data sets.
#include "model/api/dataset.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "model/api/mesh.h"
#include "model/data/framed_object.h"
#include "model/data/mesh_file.h"
#include "model/data/object_folder.h"
#include "model/data/object_names.h"
#include "model/data/random_object.h"
#include "model/data/solids.h"
#include "model/data/survey.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

char* new_json(const nlohmann::ordered_json& value) {
  return new_text(value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

std::vector<std::string> texts(const char* const* from, std::size_t count) {
  std::vector<std::string> out;
  out.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    need(from[i], "a path");
    out.emplace_back(from[i]);
  }
  return out;
}

const DataObject& object_at(vsplat_dataset dataset, std::size_t index) {
  need(dataset, "dataset");
  if (index >= dataset->data.objects.size())
    fail(Status::usage, "there is no object {}: {} in all", index, dataset->data.objects.size());
  return dataset->data.objects[index];
}

}  // namespace

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

vsplat_status vsplat_mesh_procedural_with(const vsplat_mesh_procedural_options* options, vsplat_mesh* out_mesh) {
  return guarded([&] {
    need(out_mesh, "out_mesh");
    const vsplat_mesh_procedural_options o = taken(options, VSPLAT_MESH_PROCEDURAL_OPTIONS_INIT, "options");
    std::optional<TextureFolder> textures;
    if (o.textures) textures.emplace(o.textures);
    *out_mesh =
        std::make_unique<vsplat_mesh_impl>(random_object(o.seed, o.index, textures ? &*textures : nullptr)).release();
  });
}

void vsplat_mesh_retain(vsplat_mesh mesh) { retain(mesh); }
void vsplat_mesh_release(vsplat_mesh mesh) { release(mesh); }

vsplat_status vsplat_mesh_get_info(vsplat_mesh mesh, vsplat_mesh_info* out_info) {
  return guarded([&] {
    need(mesh, "mesh");
    vsplat_mesh_info info = VSPLAT_MESH_INFO_INIT;
    if (const auto* textured = std::get_if<Mesh>(&mesh->mesh)) {
      std::set<const Texture*> textures;
      for (const Material& material : textured->palette)
        for (const Texture* texture : {material.texture.get(), material.emission_texture.get()})
          if (texture) textures.insert(texture);
      info.triangles = textured->triangles();
      info.textures = textures.size();
    } else {
      const auto& surface = std::get<SurfaceMesh>(mesh->mesh);
      info.triangles = surface.triangle_count();
      info.vertices = surface.vertex_count();
    }
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
    if (const auto* textured = std::get_if<Mesh>(&mesh->mesh))
      write_object(folder, *textured, object);
    else
      write_object(folder, with_corners(std::get<SurfaceMesh>(mesh->mesh)), object);
  });
}

vsplat_status vsplat_object_names(const char* const* paths, size_t num_paths, char** out_text) {
  return guarded([&] {
    need(out_text, "out_text");
    need_array(paths, num_paths, "paths");
    *out_text = new_json(object_names(texts(paths, num_paths)));
  });
}

vsplat_status vsplat_dataset_open(const char* const* paths, size_t num_paths, vsplat_dataset* out_dataset) {
  return guarded([&] {
    need(out_dataset, "out_dataset");
    need_array(paths, num_paths, "paths");
    if (num_paths == 0) fail(Status::usage, "num_paths is 0");
    *out_dataset = std::make_unique<vsplat_dataset_impl>(open_data_set(texts(paths, num_paths))).release();
  });
}

void vsplat_dataset_retain(vsplat_dataset dataset) { retain(dataset); }
void vsplat_dataset_release(vsplat_dataset dataset) { release(dataset); }

vsplat_status vsplat_dataset_count(vsplat_dataset dataset, size_t* out_count) {
  return guarded([&] {
    need(dataset, "dataset");
    need(out_count, "out_count");
    *out_count = dataset->data.objects.size();
  });
}

vsplat_status vsplat_dataset_describe(vsplat_dataset dataset, size_t index, char** out_text) {
  return guarded([&] {
    const DataObject& object = object_at(dataset, index);
    need(out_text, "out_text");
    *out_text = new_json(nlohmann::ordered_json{
        {"name", object.name}, {"layout", name_of(object.layout)}, {"path", object.path.string()}});
  });
}

vsplat_status vsplat_dataset_survey(vsplat_dataset dataset, size_t index, int32_t pictures,
                                    vsplat_dataset_object* out_object, char** out_bad) {
  return guarded([&] {
    require_output(out_object, "out_object");
    const ObjectSurvey found = survey(object_at(dataset, index), pictures);
    vsplat_dataset_object out = VSPLAT_DATASET_OBJECT_INIT;
    out.views = found.views;
    out.bad = static_cast<int32_t>(found.bad.size());
    out.min_width = static_cast<int32_t>(found.width.low), out.max_width = static_cast<int32_t>(found.width.high);
    out.min_height = static_cast<int32_t>(found.height.low), out.max_height = static_cast<int32_t>(found.height.high);
    out.min_fov = found.fov.low, out.max_fov = found.fov.high;
    out.min_distance = found.distance.low, out.max_distance = found.distance.high;
    for (int i = 0; i < 3; ++i) out.center[i] = found.placement.centre[i];
    out.scale = found.placement.edge;
    out.pictures = found.looked_at;
    out.coverage = found.coverage;
    give(out_object, out, "out_object");
    if (out_bad) *out_bad = new_json(found.bad);
  });
}

vsplat_status vsplat_dataset_get_picture(vsplat_dataset dataset, size_t index, int32_t view, int32_t side,
                                         float* out_pixels, size_t capacity) {
  return guarded([&] {
    const DataObject& object = object_at(dataset, index);
    need(out_pixels, "out_pixels");
    if (side < 1 || side > 8192) fail(Status::usage, "side is {}: 1 to 8192 is possible", side);
    const std::size_t count = static_cast<std::size_t>(side) * side * 3;
    if (capacity < count) fail(Status::usage, "capacity is {} floats: the picture has {}", capacity, count);
    const FrameRequest request{side, Crop::automatic, {}};
    std::vector<std::string> skipped;
    const FramedObject framed = frame_object(object, request, &skipped);
    if (view < 0 || view >= framed.views())
      fail(Status::usage, "object {}: there is no view {}: {} in all", object.name, view, framed.views());
    std::vector<float> pixels;
    composite(store_view(framed, view, request), {1, 1, 1}, pixels);
    std::copy(pixels.begin(), pixels.end(), out_pixels);
  });
}
