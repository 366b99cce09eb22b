#include "model/io/reader/program/gltf.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <set>

#include "model/io/reader/program/gltf_material.h"
#include "model/io/reader/program/gltf_primitive.h"
#include "model/io/reader/program/gltf_scene.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Places = std::vector<Matrix4d, Eigen::aligned_allocator<Matrix4d>>;

// Supported extensions, and those that do not change colours here: they describe reflection, lights or names.
const std::set<std::string>& known_extensions() {
  static const std::set<std::string> names{"EXT_mesh_gpu_instancing",
                                           "EXT_meshopt_compression",
                                           "EXT_texture_webp",
                                           "KHR_animation_pointer",
                                           "KHR_draco_mesh_compression",
                                           "KHR_lights_punctual",
                                           "KHR_materials_anisotropy",
                                           "KHR_materials_clearcoat",
                                           "KHR_materials_dispersion",
                                           "KHR_materials_emissive_strength",
                                           "KHR_materials_ior",
                                           "KHR_materials_iridescence",
                                           "KHR_materials_pbrSpecularGlossiness",
                                           "KHR_materials_sheen",
                                           "KHR_materials_specular",
                                           "KHR_materials_unlit",
                                           "KHR_materials_variants",
                                           "KHR_mesh_quantization",
                                           "KHR_meshopt_compression",
                                           "KHR_node_visibility",
                                           "KHR_texture_transform",
                                           "KHR_xmp",
                                           "KHR_xmp_json_ld"};
  return names;
}

void check_extensions(const GltfFile& file, Library& library) {
  const Field required = file.list("extensionsRequired");
  for (std::size_t i = 0; i < required.size(); ++i) {
    const std::string name = required[i].text();
    if (known_extensions().count(name) == 0)
      fail_reading(Status::input, "extensionsRequired",
                   fmt::format("the file requires the extension {}, which is not read; save it without this extension",
                               printable(name)));
  }
  // Without these, another picture stands in: one that is read.
  static const std::set<std::string> have_fallbacks{"EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds"};
  const Field used = file.list("extensionsUsed");
  for (std::size_t i = 0; i < used.size(); ++i) {
    const std::string name = used[i].text();
    if (known_extensions().count(name) == 0 && have_fallbacks.count(name) == 0)
      library.say(Kind::note, Packer().text(fmt::format(
                                  "uses the extension {}, which is not read: its effect on the picture is missing",
                                  printable(name))));
  }
}

// Transform of normals: the inverse transpose up to a factor (the cofactor matrix), which also exists for singular
// matrices.
Matrix3d normal_transform(const Matrix4d& place) {
  const Matrix3d m = place.topLeftCorner<3, 3>();
  Matrix3d out;
  for (int i = 0; i < 3; ++i) out.col(i) = m.col((i + 1) % 3).cross(m.col((i + 2) % 3));
  return out;
}

class Teller {
 public:
  Teller(GltfFile& file, Library& library) : file_(file), teller_(library), scene_(file) {}
  void tell();

 private:
  struct Uv {
    std::optional<Numbers> numbers;
    const GltfPlacement* placement = nullptr;
    std::array<float, 2> at(std::size_t i) const {
      if (!numbers) return {};
      return placement->placed(numbers->at(i));
    }
  };
  std::set<std::size_t> used_materials() const;
  void node(std::size_t number);
  void primitive(GltfPrimitive& primitive, const std::string& name, const Places& places, const Field& skin);
  Places instances(std::size_t number) const;
  Places joints(const Field& skin) const;
  Places skinned(GltfPrimitive& primitive, const Field& skin) const;
  Uv uv(GltfPrimitive& primitive, const GltfPlacement& placement, bool needed) const;

  GltfFile& file_;
  MeshTeller teller_;
  GltfScene scene_;
  std::vector<GltfMaterial> materials_;
  Field of_mesh(std::size_t number) const { return scene_.node(number)["mesh"].in(file_.list("meshes")); }
};

std::set<std::size_t> Teller::used_materials() const {
  std::set<std::size_t> out;
  bool any = false, gaussians = false;
  for (const std::size_t number : scene_.shown()) {
    const Field primitives = of_mesh(number)["primitives"];
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      const Field material = primitives[i]["material"];
      gaussians |= primitives[i]["extensions"]["KHR_gaussian_splatting"].there();
      if (!has_triangles(primitives[i])) continue;
      any = true;
      if (material.there()) out.insert(material.index(file_.list("materials").size(), "materials"));
    }
  }
  if (!any && gaussians)
    fail_reading(Status::input, "",
                 "holds Gaussians (KHR_gaussian_splatting) and no mesh; a mesh of triangles is expected");
  if (!any) fail_reading(Status::input, "", "has no faces; a mesh of triangles is expected");
  return out;
}

void Teller::tell() {
  materials_ = read_materials(file_, used_materials(), teller_);
  std::vector<MeshMaterial> all;
  for (const GltfMaterial& material : materials_) all.push_back(material.material);
  teller_.materials(all);
  for (const std::size_t number : scene_.shown()) node(number);
  teller_.done();
}

// The transforms of a node: its own, or those of its instances.
Places Teller::instances(std::size_t number) const {
  const Field of = scene_.node(number)["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
  if (!of.there()) return {scene_.place(number)};
  std::optional<Numbers> parts[3];
  std::size_t count = 0;
  const std::pair<const char*, std::size_t> names[] = {{"TRANSLATION", 3}, {"ROTATION", 4}, {"SCALE", 3}};
  for (std::size_t i = 0; i < 3; ++i) {
    const Field part = of[names[i].first];
    if (!part.there()) continue;
    parts[i] = read_numbers(file_, part, {names[i].second});
    if (count != 0 && parts[i]->count != count)
      part.wrong(fmt::format("has {} instances, another has {}", parts[i]->count, count));
    count = parts[i]->count;
  }
  Places out;
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<double> values[3];
    for (std::size_t i = 0; i < 3; ++i)
      if (parts[i]) values[i].assign(parts[i]->at(k), parts[i]->at(k) + parts[i]->width);
    out.push_back(scene_.place(number) * transform_of(values[0], values[1], values[2]));
  }
  return out;
}

void Teller::node(std::size_t number) {
  const Field node = scene_.node(number), mesh = of_mesh(number);
  const Field morphed = node["weights"].there() ? node["weights"] : mesh["weights"];
  const std::vector<double> weights = morphed.numbers(morphed.size());
  const Field primitives = mesh["primitives"];
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    if (!has_triangles(primitives[i])) continue;
    GltfPrimitive one(file_, primitives[i], weights);
    const std::string name = mesh["name"].text(primitives[i].place());
    primitive(one, name, instances(number), node["skin"]);
  }
}

// For each joint of a skin, the transform from vertex coordinates to the scene.
Places Teller::joints(const Field& number) const {
  const Field skin = number.in(file_.list("skins")), joints = skin["joints"];
  std::optional<Numbers> bind;
  if (skin["inverseBindMatrices"].there()) bind = read_numbers(file_, skin["inverseBindMatrices"], {16});
  if (bind && bind->count < joints.size())
    skin["inverseBindMatrices"].wrong(fmt::format("has {} matrices for {} joints", bind->count, joints.size()));
  Places out;
  for (std::size_t k = 0; k < joints.size(); ++k) {
    out.push_back(scene_.place(joints[k].index(file_.list("nodes").size(), "nodes")));
    if (bind) out.back() *= Eigen::Map<const Eigen::Matrix4f>(bind->at(k)).cast<double>();
  }
  return out;
}

// The transform of each vertex: the weighted mean of its joints' transforms. The node's own transform is ignored.
Places Teller::skinned(GltfPrimitive& primitive, const Field& skin) const {
  const Places all = joints(skin);
  Places out(primitive.count(), Matrix4d::Zero());
  std::vector<double> sums(primitive.count());
  for (int set = 0; primitive.has(fmt::format("JOINTS_{}", set)); ++set) {
    const std::string name = fmt::format("JOINTS_{}", set);
    const std::vector<std::uint32_t> numbers = primitive.wholes(name);
    const auto weights = primitive.attribute(fmt::format("WEIGHTS_{}", set), {4});
    if (!weights) primitive.field()["attributes"].wrong(fmt::format("has {} and no WEIGHTS_{}", name, set));
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const double weight = weights->values[i];
      if (weight == 0) continue;
      if (numbers[i] >= all.size())
        primitive.field()["attributes"][name.c_str()].wrong(
            fmt::format("vertex {} uses joint {}, but the skin has {} joints", i / 4, numbers[i], all.size()));
      out[i / 4] += weight * all[numbers[i]];
      sums[i / 4] += weight;
    }
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (sums[i] != 0)
      out[i] /= sums[i];
    else if (!all.empty())
      out[i] = all[0];
    else
      out[i].setIdentity();
  }
  return out;
}

Teller::Uv Teller::uv(GltfPrimitive& primitive, const GltfPlacement& placement, bool needed) const {
  const std::string name = fmt::format("TEXCOORD_{}", placement.set);
  Uv out{primitive.attribute(name, {2}), &placement};
  if (!out.numbers && needed)
    primitive.field()["attributes"].wrong(fmt::format("has no {}, which its material's texture needs", name));
  return out;
}

void Teller::primitive(GltfPrimitive& primitive, const std::string& name, const Places& places, const Field& skin) {
  const Field number = primitive.field()["material"];
  const std::size_t material = number.there() ? number.whole() : materials_.size() - 1;
  const GltfMaterial& of = materials_[material];
  const Uv base = uv(primitive, of.base, false), emission = uv(primitive, of.emission, of.emission.any);
  const auto normals = primitive.attribute("NORMAL", {3});
  const auto colours = primitive.attribute("COLOR_0", {3, 4});
  const std::vector<std::uint32_t> triangles = primitive.triangles();
  const bool hangs = skin.there() && primitive.has("JOINTS_0");
  const Places each = hangs ? skinned(primitive, skin) : places;
  teller_.part({name.substr(0, 1000), static_cast<std::uint32_t>(material), base.numbers.has_value()});
  for (std::size_t k = 0; k < (hangs ? 1 : each.size()); ++k) {
    Matrix3d turn = each.empty() ? Matrix3d(Matrix3d::Identity()) : normal_transform(each[k]);
    for (const std::uint32_t i : triangles) {
      const Matrix4d& place = each[hangs ? i : k];
      if (hangs) turn = normal_transform(place);
      const float *p = primitive.positions().at(i), *n = normals ? normals->at(i) : nullptr;
      const Vector3d at = (place * Eigen::Vector4d(p[0], p[1], p[2], 1)).head<3>();
      MeshCorner c;
      for (std::size_t d = 0; d < 3; ++d) c.position[d] = static_cast<float>(at[static_cast<int>(d)]);
      if (n) {
        const Vector3d turned = (turn * Vector3d(n[0], n[1], n[2])).stableNormalized();
        for (std::size_t d = 0; d < 3; ++d) c.normal[d] = static_cast<float>(turned[static_cast<int>(d)]);
      }
      if (colours) std::copy_n(colours->at(i), colours->width, c.colour.begin());
      c.uv = base.at(i), c.emission_uv = emission.at(i);
      teller_.corner(c, i);
    }
  }
}

}  // namespace

bool read_gltf(const std::string& path, Library& library) {
  const std::unique_ptr<GltfFile> file = GltfFile::open(path, library);
  if (!file) return false;
  check_extensions(*file, library);
  Teller(*file, library).tell();
  return true;
}

}  // namespace vsplat::read
