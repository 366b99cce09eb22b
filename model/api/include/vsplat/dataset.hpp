// Meshes and data sets for C++, see vsplat/dataset.h. Part of vsplat.hpp, which includes this file.
#include <vsplat/vsplat.hpp>  // before the guard: other parts of vsplat.hpp use these

#ifndef VSPLAT_DATASET_HPP
#define VSPLAT_DATASET_HPP

#include <string>
#include <vector>

namespace vsplat {
inline namespace cxx {

using MeshHandle = Handle<vsplat_mesh, vsplat_mesh_retain, vsplat_mesh_release>;
using DataSetHandle = Handle<vsplat_dataset, vsplat_dataset_retain, vsplat_dataset_release>;

class Mesh : public MeshHandle {
 public:
  using MeshHandle::MeshHandle;
  // `texture` "": the file's own textures.
  static Mesh load(const std::string& path, const std::string& texture = "") {
    vsplat_mesh out = nullptr;
    check(vsplat_mesh_load(path.c_str(), texture.empty() ? nullptr : texture.c_str(), &out));
    return Mesh(out);
  }
  static Mesh procedural(uint64_t seed, uint32_t index) {
    vsplat_mesh out = nullptr;
    check(vsplat_mesh_procedural(seed, index, &out));
    return Mesh(out);
  }
  static Mesh procedural(const vsplat_mesh_procedural_options& options) {
    vsplat_mesh out = nullptr;
    check(vsplat_mesh_procedural_with(&options, &out));
    return Mesh(out);
  }
  vsplat_mesh_info info() const {
    vsplat_mesh_info out = VSPLAT_MESH_INFO_INIT;
    check(vsplat_mesh_get_info(get(), &out));
    return out;
  }
  void write_views(const std::string& folder, const vsplat_mesh_views_options& options) const {
    check(vsplat_mesh_write_views(get(), &options, folder.c_str()));
  }
};

class DataSet : public DataSetHandle {
 public:
  explicit DataSet(const std::vector<std::string>& paths) : DataSetHandle(open(paths)) {}

  size_t count() const {
    size_t out = 0;
    check(vsplat_dataset_count(get(), &out));
    return out;
  }
  // Returns JSON: name, layout, path.
  std::string describe(size_t index) const {
    char* out = nullptr;
    check(vsplat_dataset_describe(get(), index, &out));
    return text(out);
  }
  // `bad` receives a JSON list.
  vsplat_dataset_object survey(size_t index, int32_t pictures, std::string& bad) const {
    vsplat_dataset_object out = VSPLAT_DATASET_OBJECT_INIT;
    char* texts = nullptr;
    check(vsplat_dataset_survey(get(), index, pictures, &out, &texts));
    bad = text(texts);
    return out;
  }
  // [side][side][3] on white.
  std::vector<float> picture(size_t index, int32_t view, int32_t side) const {
    std::vector<float> out(static_cast<size_t>(side) * static_cast<size_t>(side) * 3);
    check(vsplat_dataset_get_picture(get(), index, view, side, out.data(), out.size()));
    return out;
  }

 private:
  static vsplat_dataset open(const std::vector<std::string>& paths) {
    std::vector<const char*> names;
    names.reserve(paths.size());
    for (const std::string& path : paths) names.push_back(path.c_str());
    vsplat_dataset out = nullptr;
    check(vsplat_dataset_open(names.data(), names.size(), &out));
    return out;
  }
};

}  // namespace cxx
}  // namespace vsplat

#endif
