#include "model/data/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "model/base/image.h"
#include "model/io/any_case.h"
#include "model/io/picture/image_file.h"
#include "model/io/picture/image_formats.h"
#include "model/io/reader/mesh_messages.h"
#include "model/io/reader/reader.h"
#include "model/io/views/listed_file.h"
#include "runtime/fail.h"
#include "runtime/files/roots.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3f;
using read::AlphaMode;
using read::Kind;
using read::MeshCorner;
using read::MeshMaterial;
using read::MeshPart;
using read::Message;
using read::Unpacker;

// Allowed for any file: instancing lets a small file have many triangles.
constexpr std::uint64_t free_triangles = std::uint64_t{4} << 20;

std::string extension_of(const std::string& path) {
  std::string out = fs::path(path).extension().string();
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

// Whether it is glTF, whose colours are linear; those of other formats are sRGB-encoded.
bool is_gltf(const std::string& path) {
  const std::string extension = extension_of(path);
  if (extension == ".glb" || extension == ".gltf") return true;
  if (extension == ".obj" || extension == ".ply" || extension == ".stl") return false;
  fail(Status::input, "{}: meshes are read from .obj, .ply, .stl, .gltf and .glb, not from {}", path,
       extension.empty() ? "a file without an ending" : printable(extension));
}

const std::string& regular(const std::string& path) {
  std::error_code problem;
  if (!fs::is_regular_file(path, problem)) fail(Status::file, "{}: there is no such file; a mesh is expected", path);
  return path;
}

Sampling sampling_of(const read::MeshTexture& texture) {
  const auto beyond = [](read::Wrap wrap) {
    return wrap == read::Wrap::clamp ? Beyond::clamp : wrap == read::Wrap::mirror ? Beyond::mirror : Beyond::repeat;
  };
  return {beyond(texture.wrap_u), beyond(texture.wrap_v), texture.nearest};
}

// The folders in which a mesh's textures may be: its own, and usual subfolders.
std::vector<fs::path> places_of(const fs::path& folder) {
  std::vector<fs::path> out = {folder};
  for (const char* name : {"textures", "texture", "images", "maps"}) {
    std::error_code problem;
    if (const fs::path place = in_any_case(folder, name); fs::is_directory(place, problem)) out.push_back(place);
  }
  return out;
}

class MeshReader {
 public:
  MeshReader(const std::string& path, const std::string& texture)
      : path_(regular(path)),
        folder_(fs::path(path).parent_path()),
        gltf_(is_gltf(path)),
        files_(places_of(folder_), folder_, &roots_),
        reader_(path, Kind::mesh, "its file") {
    roots_.add(folder_.empty() ? "." : folder_);
    reader_.search_by([this](const std::string& name) { return other_place(name); });
    if (!texture.empty()) everywhere_ = texture_of(*ImageFile(texture).rows());
  }
  Mesh read();

 private:
  void take(const Message& message);
  void take_texture(Unpacker& in);
  void take_materials(Unpacker& in);
  void take_part(Unpacker& in);
  void take_corners(Unpacker& in);
  void take_note(Unpacker& in);

  Vector3f linear(const float* colour) const;
  Vector3f emission(const std::array<float, 3>& from) const;
  std::string other_place(const std::string& name);
  std::shared_ptr<const Texture> texture(const std::string& name);
  void read_holes(const MeshMaterial& from, Material& out) const;
  Material material(const MeshMaterial& from);
  Corner corner(const MeshCorner& from) const;
  std::uint64_t most_bytes() const { return reader_.given() + (std::uint64_t{4} << 20); }  // limit for a message

  const std::string& path_;
  const fs::path folder_;
  const bool gltf_;
  Roots roots_;  // of the textures
  ListedFiles files_;
  std::shared_ptr<const Texture> everywhere_;
  Reader reader_;
  std::map<std::string, std::shared_ptr<const Texture>> textures_;
  Mesh mesh_;
  std::uint32_t part_material_ = 0;
  bool in_part_ = false, done_ = false;
  int notes_ = 0;
};

Vector3f MeshReader::linear(const float* colour) const {
  const Vector3f out = Vector3f(colour[0], colour[1], colour[2]).cwiseMax(0.0f).cwiseMin(1.0f);
  return gltf_ ? out : Vector3f(out.unaryExpr(&srgb_decode));
}

Vector3f MeshReader::emission(const std::array<float, 3>& from) const {
  if (!gltf_) return linear(from.data());
  return Vector3f(from[0], from[1], from[2]).cwiseMax(0.0f);
}

// Receives a picture embedded in the file, which precedes the material that uses it.
void MeshReader::take_texture(Unpacker& in) {
  const std::string name = in.text();
  const std::string_view bytes = in.rest();
  if (everywhere_) return;
  const std::string where = fmt::format("{} (its texture {})", path_, printable(name));
  textures_[name] =
      texture_of(*open_picture({where, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()}));
}

// A stand-in for a missing file that the mesh names (materials, buffers): one of the same name in another case, or one
// found by the end of its path. "" if there is none.
std::string MeshReader::other_place(const std::string& name) {
  std::string listed = name;
  if (const std::string beside = (folder_ / "").string(); listed.starts_with(beside)) listed.erase(0, beside.size());
  return files_.find_with_ending(listed).string();
}

// Finds the texture with the same search as the pictures of a list.
std::shared_ptr<const Texture> MeshReader::texture(const std::string& name) {
  std::shared_ptr<const Texture>& known = textures_[name];
  if (known) return known;
  fs::path file;
  try {
    file = files_.find(name).path;
  } catch (const Error& e) {
    fail(e.status(), "{}: its texture: {}", path_, e.what());
  }
  if (file.empty())
    fail(Status::input, "{}: its texture {} is missing ({}); add the file, or give another texture ({})", path_,
         printable(name), files_.where_looked(name), Option::texture);
  roots_.need(file, path_ + ": its texture");
  return known = texture_of(*ImageFile(file.string()).rows());
}

// In glTF, alpha matters if the material says so. Blended surfaces exist here where alpha is at least a half.
void MeshReader::read_holes(const MeshMaterial& from, Material& out) const {
  if (from.alpha == AlphaMode::none) return;
  out.alpha = from.has_factor ? from.factor[3] : 1.0f;
  out.cutoff = from.alpha == AlphaMode::mask ? from.cutoff : 0.5f;
}

Material MeshReader::material(const MeshMaterial& from) {
  Material out;
  if (everywhere_) {
    out.texture = everywhere_;
    return out;
  }
  if (!from.texture.name.empty()) out.texture = texture(from.texture.name);
  out.sampling = sampling_of(from.texture);
  out.emission = emission(from.emission);
  if (!from.emission_texture.name.empty()) out.emission_texture = texture(from.emission_texture.name);
  out.emission_sampling = sampling_of(from.emission_texture);
  // Kd beside map_Kd is an arbitrary value left by the exporter; the meaning of glTF's factor is defined.
  if (gltf_) {
    read_holes(from, out);
  } else if (out.texture && !out.texture->alpha.empty()) {
    out.cutoff = 0.5f;
  }
  if (gltf_ && from.has_factor)
    out.colour = linear(from.factor.data());
  else if (!out.texture && from.has_diffuse)
    out.colour = linear(from.diffuse.data());
  return out;
}

void MeshReader::take_materials(Unpacker& in) {
  const std::string& lost = reader_.missing();
  if (!lost.empty() && !everywhere_ && extension_of(lost) == ".mtl")
    fail(Status::input, "{}: its material file {} is missing; add the file, or give a texture ({})", path_,
         printable(lost), Option::texture);
  if (!mesh_.palette.empty()) throw read::BadMessage("materials twice");
  for (auto left = in.get<std::uint32_t>(); left > 0; --left)
    mesh_.palette.push_back(material(read::unpack_material(in)));
}

void MeshReader::take_part(Unpacker& in) {
  const MeshPart part = read::unpack_part(in);
  if (part.material >= mesh_.palette.size()) throw read::BadMessage("a part of a material that is not there");
  if (mesh_.palette[part.material].texture && !part.has_uv)
    fail(Status::input, "{}: part \"{}\" is to be textured, but has no texture coordinates", path_,
         printable(part.name));
  part_material_ = part.material;
  in_part_ = true;
}

Corner MeshReader::corner(const MeshCorner& from) const {
  Corner c;
  c.position = Vector3f(from.position[0], from.position[1], from.position[2]);
  c.normal = Vector3f(from.normal[0], from.normal[1], from.normal[2]);
  if (!everywhere_) c.colour = linear(from.colour.data());
  if (!everywhere_) c.alpha = from.colour[3];
  c.uv = {from.uv[0], from.uv[1]};
  c.emission_uv = {from.emission_uv[0], from.emission_uv[1]};
  if (!c.position.allFinite() || !c.normal.allFinite() || !c.colour.allFinite() || !c.uv.allFinite() ||
      !c.emission_uv.allFinite() || !std::isfinite(c.alpha))
    throw read::BadMessage("a corner that is not finite");
  return c;
}

void MeshReader::take_corners(Unpacker& in) {
  if (!in_part_ || in.left() % (3 * sizeof(MeshCorner)) != 0) throw read::BadMessage("triangles out of place");
  const std::size_t triangles = in.left() / (3 * sizeof(MeshCorner));
  const std::uint64_t most = free_triangles + reader_.given();
  if (mesh_.triangles() + triangles > most)
    reader_.give_up(Status::format,
                    fmt::format("has more than {} triangles, which is too many for a file of its size", most));
  const std::string_view bytes = in.rest();
  for (std::size_t i = 0; i < 3 * triangles; ++i) {
    MeshCorner from;
    std::memcpy(&from, bytes.data() + i * sizeof from, sizeof from);
    mesh_.corners.push_back(corner(from));
  }
  mesh_.materials.insert(mesh_.materials.end(), triangles, part_material_);
}

void MeshReader::take_note(Unpacker& in) {
  constexpr int most = 10;
  const std::string text = in.text();
  if (notes_++ < most) warn("{}: {}", path_, words_of_reader(text));
}

void MeshReader::take(const Message& message) {
  Unpacker in(message.body);
  switch (message.kind) {
    case Kind::texture:
      take_texture(in);
      break;
    case Kind::materials:
      take_materials(in);
      break;
    case Kind::part:
      take_part(in);
      break;
    case Kind::corners:
      take_corners(in);
      break;
    case Kind::note:
      take_note(in);
      break;
    case Kind::done:
      done_ = true;
      break;
    default:
      throw read::BadMessage("another message than one of a mesh");
  }
  in.end();
}

Mesh MeshReader::read() {
  mesh_.name = path_;
  reader_.ask(Kind::mesh, read::Packer().text(path_));
  while (!done_) {
    const Message message = reader_.next(most_bytes());
    if (!reader_.refused().empty()) fail(Status::file, "{}: {}", path_, reader_.refused());
    try {
      take(message);
    } catch (const read::BadMessage& e) {
      reader_.senseless(e.what());
    } catch (const std::bad_alloc&) {
      reader_.give_up(Status::memory, fmt::format("not enough host memory for its {} triangles", mesh_.triangles()));
    }
  }
  if (mesh_.triangles() == 0) fail(Status::input, "{}: has no faces; a mesh of triangles is expected", path_);
  compute_normals(mesh_);
  return std::move(mesh_);
}

}  // namespace

Mesh load_mesh(const std::string& path, const std::string& texture) { return MeshReader(path, texture).read(); }

}  // namespace vsplat
