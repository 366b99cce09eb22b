#include "model/read/program/mesh.h"

#include <assimp/BaseImporter.h>
#include <assimp/GltfMaterial.h>
#include <assimp/importerdesc.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <set>
#include <sstream>

#include "model/read/mesh_messages.h"
#include "model/read/program/mesh_files.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

constexpr unsigned batch = 16'384;  // triangles a message

bool is_promised(const char* extensions) {
  std::istringstream in(extensions ? extensions : "");
  for (std::string extension; in >> extension;)
    if (extension == "obj" || extension == "ply" || extension == "stl" || extension == "gltf" || extension == "glb")
      return true;
  return false;
}

// assimp has dozens, which look at any file's beginning.
void drop_other_importers(Assimp::Importer& importer) {
  for (std::size_t i = importer.GetImporterCount(); i-- > 0;)
    if (!is_promised(importer.GetImporterInfo(i)->mFileExtensions)) importer.UnregisterLoader(importer.GetImporter(i));
}

// Before anything of assimp's follows the indices.
void check_faces(const aiScene& scene) {
  bool any = false;
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const aiMesh& part = *scene.mMeshes[i];
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      any = any || face.mNumIndices >= 3;
      for (unsigned k = 0; k < face.mNumIndices; ++k)
        if (face.mIndices[k] >= part.mNumVertices)
          fail_reading(Status::format, "",
                       fmt::format("face {} of part \"{}\" uses vertex {}, there are {}", f,
                                   printable(part.mName.C_Str()), face.mIndices[k], part.mNumVertices));
    }
  }
  if (!any) fail_reading(Status::input, "", "has no faces; a mesh of triangles is expected");
}

std::array<float, 4> values(const aiColor4D& c) {
  std::array<float, 4> out{c.r, c.g, c.b, c.a};
  for (float& value : out)
    if (!std::isfinite(value))
      fail_reading(Status::input, "", fmt::format("a material's colour holds {}; finite numbers are expected", value));
  return out;
}

class Teller {
 public:
  Teller(const aiScene& scene, Library& library) : scene_(scene), library_(library) {}
  void tell();

 private:
  MeshMaterial material(const aiMaterial& from);
  void embedded(const std::string& name);
  void part(const aiMesh& part);
  MeshCorner corner(const aiMesh& part, unsigned i) const;

  const aiScene& scene_;
  Library& library_;
  std::set<std::string> told_;  // embedded pictures
};

// A picture inside the file. (Those importers leave all of them as they are encoded.)
void Teller::embedded(const std::string& name) {
  const aiTexture* inside = scene_.GetEmbeddedTexture(name.c_str());
  if (!inside || !told_.insert(name).second) return;
  if (inside->mHeight != 0)
    fail_reading(Status::format, "", fmt::format("its texture {} is in a form that is not read", printable(name)));
  Packer body;
  body.text(name).raw(inside->pcData, inside->mWidth);
  library_.say(Kind::texture, body);
}

MeshMaterial Teller::material(const aiMaterial& from) {
  MeshMaterial out;
  aiString name;
  for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE})
    if (!out.has_texture && from.GetTexture(type, 0, &name) == aiReturn_SUCCESS)
      out.has_texture = true, out.texture = name.C_Str();
  if (out.has_texture) embedded(out.texture);
  aiColor4D colour;
  out.has_factor = from.Get(AI_MATKEY_BASE_COLOR, colour) == aiReturn_SUCCESS;
  if (out.has_factor) out.factor = values(colour);
  out.has_diffuse = from.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == aiReturn_SUCCESS;
  if (out.has_diffuse) out.diffuse = values(colour);
  aiString mode;
  if (from.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) != aiReturn_SUCCESS) return out;
  const std::string is = mode.C_Str();
  out.alpha = is == "MASK" ? AlphaMode::mask : is == "BLEND" ? AlphaMode::blend : AlphaMode::none;
  if (is == "MASK") from.Get(AI_MATKEY_GLTF_ALPHACUTOFF, out.cutoff);
  if (!std::isfinite(out.cutoff)) fail_reading(Status::input, "", "a material's alphaCutoff is not finite");
  return out;
}

MeshCorner Teller::corner(const aiMesh& part, unsigned i) const {
  MeshCorner c;
  c.position = {part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z};
  if (part.HasNormals()) {
    const aiVector3D& n = part.mNormals[i];
    const float length = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    if (length > 1e-6f && std::isfinite(length)) c.normal = {n.x / length, n.y / length, n.z / length};
  }
  if (part.HasVertexColors(0)) {
    const aiColor4D& of = part.mColors[0][i];
    c.colour = {std::clamp(of.r, 0.0f, 1.0f), std::clamp(of.g, 0.0f, 1.0f), std::clamp(of.b, 0.0f, 1.0f)};
  }
  if (part.HasTextureCoords(0)) c.uv = {part.mTextureCoords[0][i].x, part.mTextureCoords[0][i].y};
  const auto finite = [](const auto& all) {
    return std::all_of(all.begin(), all.end(), [](float v) { return std::isfinite(v); });
  };
  if (!finite(c.position) || !finite(c.uv) || !finite(c.colour))
    fail_reading(
        Status::input, "",
        fmt::format("vertex {} of part \"{}\" is at {}, {}, {} with texture coordinates {}, {}; all finite is "
                    "expected",
                    i, printable(part.mName.C_Str()), c.position[0], c.position[1], c.position[2], c.uv[0], c.uv[1]));
  return c;
}

void Teller::part(const aiMesh& part) {
  Packer head;
  pack(MeshPart{part.mName.C_Str(), part.mMaterialIndex, part.HasTextureCoords(0)}, head);
  library_.say(Kind::part, head);
  std::vector<MeshCorner> corners;
  corners.reserve(3 * static_cast<std::size_t>(std::min(batch, part.mNumFaces)));
  const auto say = [&] {
    if (!corners.empty())
      library_.say(Kind::corners, Packer().raw(corners.data(), corners.size() * sizeof(MeshCorner)));
    corners.clear();
  };
  for (unsigned f = 0; f < part.mNumFaces; ++f) {
    const aiFace& face = part.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines
    for (unsigned k = 0; k < 3; ++k) corners.push_back(corner(part, face.mIndices[k]));
    if (corners.size() == 3 * static_cast<std::size_t>(batch)) say();
  }
  say();
}

void Teller::tell() {
  Packer materials;
  materials.put(std::uint32_t{scene_.mNumMaterials});
  for (unsigned i = 0; i < scene_.mNumMaterials; ++i) pack(material(*scene_.mMaterials[i]), materials);
  library_.say(Kind::materials, materials);
  for (unsigned i = 0; i < scene_.mNumMeshes; ++i) part(*scene_.mMeshes[i]);
  library_.say(Kind::done);
}

}  // namespace

void read_mesh(const std::string& path, Library& library) {
  Assimp::Importer& importer = *new Assimp::Importer;  // the process ends before it would be freed
  drop_other_importers(importer);
  importer.SetIOHandler(new MeshFiles(library));  // the importer deletes it
  // Bones, cameras and the like would only be moved about.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                                          aiComponent_LIGHTS | aiComponent_CAMERAS |
                                                          aiComponent_TANGENTS_AND_BITANGENTS);
  const auto refuse_unread = [&](const aiScene* scene) {
    if (!scene)
      fail_reading(Status::format, "",
                   fmt::format("cannot be read as a mesh: {}", printable(importer.GetErrorString())));
  };
  refuse_unread(importer.ReadFile(path, 0));
  check_faces(*importer.GetScene());
  refuse_unread(
      importer.ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_Triangulate | aiProcess_PreTransformVertices));
  Teller(*importer.GetScene(), library).tell();
}

}  // namespace vsplat::read
