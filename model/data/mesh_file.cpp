#include "model/data/mesh_file.h"

#include <assimp/DefaultIOSystem.h>
#include <assimp/GltfMaterial.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <filesystem>
#include <map>

#include "model/base/image.h"
#include "model/io/image_file.h"
#include "model/io/image_formats.h"
#include "runtime/fail.h"
#include "runtime/file.h"
#include "runtime/printable.h"
#include "runtime/roots.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3f;

// What assimp asks for beside the mesh: it only warns where an OBJ names a material file that is not there.
struct OtherFiles {
  std::string missing, refused;  // the first of each; an error's text
};

class WatchedFiles : public Assimp::DefaultIOSystem {
 public:
  WatchedFiles(const std::string& mesh, Roots& roots, OtherFiles& others)
      : mesh_(mesh), roots_(roots), others_(others) {}
  // assimp's own opens it to see, and waits where it is a pipe.
  bool Exists(const char* path) const override {
    std::error_code ignored;
    return fs::exists(path, ignored);
  }
  Assimp::IOStream* Open(const char* path, const char* mode) override {
    if (!may_be_read(path)) return nullptr;
    Assimp::IOStream* stream = DefaultIOSystem::Open(path, mode);
    if (!stream && others_.missing.empty()) others_.missing = path;
    return stream;
  }

 private:
  bool may_be_read(const std::string& path) {
    std::error_code ignored;
    if (fs::equivalent(path, mesh_, ignored) || !fs::exists(path, ignored)) return true;
    try {
      roots_.need(path, "its file");
      open_regular(path);
      return true;
    } catch (const Error& e) {
      if (others_.refused.empty()) others_.refused = mesh_ + ": " + e.what();
      return false;
    }
  }

  const std::string& mesh_;
  Roots& roots_;
  OtherFiles& others_;
};

std::string extension_of(const std::string& path) {
  std::string out = fs::path(path).extension().string();
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

// Before anything of assimp's follows the indices.
void check_faces(const aiScene& scene, const std::string& path) {
  bool any = false;
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const aiMesh& part = *scene.mMeshes[i];
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      any = any || face.mNumIndices >= 3;
      for (unsigned k = 0; k < face.mNumIndices; ++k)
        if (face.mIndices[k] >= part.mNumVertices)
          fail(Status::format, "{}: face {} of part \"{}\" uses vertex {}, there are {}", path, f,
               printable(part.mName.C_Str()), face.mIndices[k], part.mNumVertices);
    }
  }
  if (!any) fail(Status::input, "{}: has no faces; a mesh of triangles is expected", path);
}

class Reader {
 public:
  Reader(const std::string& path, const std::string& texture) : path_(path) {
    const std::string extension = extension_of(path);
    gltf_ = extension == ".glb" || extension == ".gltf";
    const fs::path folder = fs::path(path).parent_path();
    roots_.add(folder.empty() ? "." : folder);
    if (!texture.empty()) everywhere_ = texture_of(read_image(texture));
  }
  Mesh read();

 private:
  const aiScene& scene() const { return *importer_.GetScene(); }
  Vector3f linear(const aiColor4D& c) const;
  std::shared_ptr<const Texture> texture(const aiString& name);
  std::shared_ptr<const Texture> embedded(const aiTexture& from, const std::string& where) const;
  static void read_holes(const aiMaterial& from, float alpha, Material& out);
  Material material(const aiMaterial& from);
  void append(const aiMesh& part, Mesh& out) const;

  const std::string& path_;
  bool gltf_ = false;  // whose colours are in linear light; others' are sRGB-encoded
  Roots roots_;        // of what it names
  std::shared_ptr<const Texture> everywhere_;
  Assimp::Importer importer_;
  std::map<std::string, std::shared_ptr<const Texture>> textures_;
};

Vector3f Reader::linear(const aiColor4D& c) const {
  const Vector3f out = Vector3f(c.r, c.g, c.b).cwiseMax(0.0f).cwiseMin(1.0f);
  return gltf_ ? out : Vector3f(out.unaryExpr(&srgb_decode));
}

std::shared_ptr<const Texture> Reader::embedded(const aiTexture& from, const std::string& where) const {
  const auto* bytes = reinterpret_cast<const unsigned char*>(from.pcData);
  if (from.mHeight == 0) return texture_of(decode_image({where, bytes, from.mWidth}));
  auto out = std::make_shared<Texture>();
  out->width = static_cast<int>(from.mWidth);
  out->height = static_cast<int>(from.mHeight);
  const std::size_t texels = static_cast<std::size_t>(from.mWidth) * from.mHeight;
  for (std::size_t i = 0; i < texels; ++i) {
    out->rgb.insert(out->rgb.end(), {from.pcData[i].r, from.pcData[i].g, from.pcData[i].b});
    out->alpha.push_back(from.pcData[i].a);
  }
  return out;
}

std::shared_ptr<const Texture> Reader::texture(const aiString& name) {
  std::shared_ptr<const Texture>& known = textures_[name.C_Str()];
  if (known) return known;
  if (const aiTexture* inside = scene().GetEmbeddedTexture(name.C_Str()))
    return known = embedded(*inside, fmt::format("{} (its texture {})", path_, printable(name.C_Str())));
  std::string file = name.C_Str();
  std::replace(file.begin(), file.end(), '\\', '/');
  const fs::path full = fs::path(path_).parent_path() / file;
  std::error_code ignored;
  if (!fs::exists(full, ignored))
    fail(Status::input, "{}: its texture {} is missing; put it there, or give another to vsplat_mesh_load", path_,
         printable(full.string()));
  roots_.need(full, path_ + ": its texture");
  return known = texture_of(read_image(full.string()));
}

// glTF: alpha counts where the material says so. What is blended there is a surface here where it is at least half.
void Reader::read_holes(const aiMaterial& from, float alpha, Material& out) {
  aiString mode;
  if (from.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) != aiReturn_SUCCESS) return;
  const std::string is = mode.C_Str();
  if (is != "MASK" && is != "BLEND") return;
  out.alpha = alpha;
  out.cutoff = 0.5f;
  if (is == "MASK") from.Get(AI_MATKEY_GLTF_ALPHACUTOFF, out.cutoff);
}

Material Reader::material(const aiMaterial& from) {
  Material out;
  if (everywhere_) {
    out.texture = everywhere_;
    return out;
  }
  aiString name;
  for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE})
    if (!out.texture && from.GetTexture(type, 0, &name) == aiReturn_SUCCESS) out.texture = texture(name);
  // Kd beside map_Kd is whatever the exporter left there; glTF says what its factor means.
  aiColor4D colour;
  const bool factor = from.Get(AI_MATKEY_BASE_COLOR, colour) == aiReturn_SUCCESS;
  if (gltf_) {
    read_holes(from, factor ? colour.a : 1.0f, out);
  } else if (out.texture && !out.texture->alpha.empty()) {
    out.cutoff = 0.5f;
  }
  if ((gltf_ && factor) || (!out.texture && from.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == aiReturn_SUCCESS))
    out.colour = linear(colour);
  return out;
}

void Reader::append(const aiMesh& part, Mesh& out) const {
  const Material& material = out.palette[part.mMaterialIndex];
  const std::string name = printable(part.mName.C_Str());
  if (material.texture && !part.HasTextureCoords(0))
    fail(Status::input, "{}: part \"{}\" is to be textured and has no texture coordinates", path_, name);
  for (unsigned f = 0; f < part.mNumFaces; ++f) {
    const aiFace& face = part.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines
    for (unsigned k = 0; k < 3; ++k) {
      const unsigned i = face.mIndices[k];
      Corner c;
      c.position = Vector3f(part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z);
      if (part.HasNormals()) {
        const Vector3f normal(part.mNormals[i].x, part.mNormals[i].y, part.mNormals[i].z);
        const float length = normal.norm();
        if (length > 1e-6f && std::isfinite(length)) c.normal = normal / length;  // else it is computed
      }
      if (part.HasVertexColors(0) && !everywhere_) c.colour = linear(part.mColors[0][i]);
      if (part.HasTextureCoords(0)) c.uv = {part.mTextureCoords[0][i].x, part.mTextureCoords[0][i].y};
      if (!c.position.allFinite() || !c.uv.allFinite() || !c.colour.allFinite())
        fail(Status::input,
             "{}: vertex {} of part \"{}\" is at {}, {}, {} with texture coordinates {}, {}; all finite is expected",
             path_, i, name, c.position.x(), c.position.y(), c.position.z(), c.uv.x(), c.uv.y());
      out.corners.push_back(c);
    }
    out.materials.push_back(part.mMaterialIndex);
  }
}

Mesh Reader::read() {
  std::error_code problem;
  if (!fs::is_regular_file(path_, problem)) fail(Status::file, "{}: there is no such file; a mesh is expected", path_);
  OtherFiles others;
  importer_.SetIOHandler(new WatchedFiles(path_, roots_, others));  // the importer deletes it
  // Bones, cameras and the like would only be moved about.
  importer_.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                                           aiComponent_LIGHTS | aiComponent_CAMERAS |
                                                           aiComponent_TANGENTS_AND_BITANGENTS);
  const auto refuse_unread = [&](const aiScene* scene) {
    if (!others.refused.empty()) fail(Status::file, "{}", others.refused);
    if (!scene) fail(Status::format, "{}: cannot be read as a mesh: {}", path_, printable(importer_.GetErrorString()));
  };
  refuse_unread(importer_.ReadFile(path_, 0));
  check_faces(scene(), path_);
  refuse_unread(importer_.ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_Triangulate |
                                              aiProcess_PreTransformVertices));
  if (!others.missing.empty() && !everywhere_ && extension_of(others.missing) == ".mtl")
    fail(Status::input, "{}: its material file {} is missing; put it there, or give a texture to vsplat_mesh_load",
         path_, printable(others.missing));
  Mesh out;
  out.name = path_;
  for (unsigned i = 0; i < scene().mNumMaterials; ++i) out.palette.push_back(material(*scene().mMaterials[i]));
  for (unsigned i = 0; i < scene().mNumMeshes; ++i) append(*scene().mMeshes[i], out);
  if (out.triangles() == 0) fail(Status::input, "{}: has no faces; a mesh of triangles is expected", path_);
  compute_normals(out);
  return out;
}

}  // namespace

Mesh load_mesh(const std::string& path, const std::string& texture) { return Reader(path, texture).read(); }

}  // namespace vsplat
