#include "model/io/reader/program/assimp.h"

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

#include "model/io/reader/program/mesh_files.h"
#include "model/io/reader/program/mesh_teller.h"
#include "model/io/reader/program/triangulate.h"
#include "runtime/message_text.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

bool is_promised(const char* extensions) {
  std::istringstream in(extensions ? extensions : "");
  for (std::string extension; in >> extension;)
    if (extension == "obj" || extension == "ply" || extension == "stl" || extension == "gltf" || extension == "glb")
      return true;
  return false;
}

// assimp has dozens of importers, which examine the beginning of any file.
void drop_other_importers(Assimp::Importer& importer) {
  for (std::size_t i = importer.GetImporterCount(); i-- > 0;)
    if (!is_promised(importer.GetImporterInfo(i)->mFileExtensions)) importer.UnregisterLoader(importer.GetImporter(i));
}

// Must run before any step of assimp that follows the indices.
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
      fail_reading(Status::input, "",
                   fmt::format("a material's colour holds {}; finite numbers are expected", number_text(value)));
  return out;
}

// The largest component of any vertex colour.
float brightest(const aiScene& scene) {
  float out = 0;
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const aiMesh& part = *scene.mMeshes[i];
    for (unsigned k = 0; part.HasVertexColors(0) && k < part.mNumVertices; ++k) {
      const aiColor4D& c = part.mColors[0][k];
      out = std::max({out, c.r, c.g, c.b});
    }
  }
  return out;
}

class Teller {
 public:
  Teller(const aiScene& scene, const MtlMaterials& mtl, Library& library)
      : scene_(scene), mtl_(mtl), library_(library), teller_(library) {}
  void tell();

 private:
  MeshMaterial material(const aiMaterial& from);
  MeshTexture texture(const aiMaterial& from, const std::vector<aiTextureType>& types, const MtlTexture* mtl);
  void embedded(const std::string& name);
  void part(const aiMesh& part);
  MeshCorner corner(const aiMesh& part, const MtlMaterial* mtl, unsigned i) const;
  bool is_made_up(unsigned material) const;

  const aiScene& scene_;
  const MtlMaterials& mtl_;
  Library& library_;
  MeshTeller teller_;
  std::set<std::string> sent_;  // embedded pictures already sent
  float colour_scale_ = 1;      // for vertex colours
};

std::string name_of(const aiMaterial& material) {
  aiString name;
  return material.Get(AI_MATKEY_NAME, name) == aiReturn_SUCCESS ? name.C_Str() : "";
}

// Sends a picture embedded in the file. The enabled importers keep these in their encoded form.
void Teller::embedded(const std::string& name) {
  const aiTexture* inside = scene_.GetEmbeddedTexture(name.c_str());
  if (!inside || !sent_.insert(name).second) return;
  if (inside->mHeight != 0)
    fail_reading(Status::format, "", fmt::format("its texture {} is in a form that is not read", printable(name)));
  teller_.texture(name, {reinterpret_cast<const unsigned char*>(inside->pcData), inside->mWidth});
}

// The first texture of `types` that the material has.
MeshTexture Teller::texture(const aiMaterial& from, const std::vector<aiTextureType>& types, const MtlTexture* mtl) {
  MeshTexture out;
  aiString name;
  for (const aiTextureType type : types)
    if (out.name.empty() && from.GetTexture(type, 0, &name) == aiReturn_SUCCESS) out.name = name.C_Str();
  if (!out.name.empty()) embedded(out.name);
  if (mtl && mtl->clamp) out.wrap_u = out.wrap_v = Wrap::clamp;
  return out;
}

MeshMaterial Teller::material(const aiMaterial& from) {
  MeshMaterial out;
  const MtlMaterial* mtl = mtl_.find(name_of(from));
  out.texture = texture(from, {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}, mtl ? &mtl->diffuse : nullptr);
  aiColor4D colour;
  out.has_factor = from.Get(AI_MATKEY_BASE_COLOR, colour) == aiReturn_SUCCESS;
  if (out.has_factor) out.factor = values(colour);
  out.has_diffuse = from.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == aiReturn_SUCCESS;
  if (out.has_diffuse) out.diffuse = values(colour);
  if (mtl) {
    out.emission_texture = texture(from, {aiTextureType_EMISSIVE}, &mtl->emission);
    const bool said = from.Get(AI_MATKEY_COLOR_EMISSIVE, colour) == aiReturn_SUCCESS;
    const std::array<float, 4> light = said ? values(colour) : std::array<float, 4>{};
    std::copy_n(light.begin(), 3, out.emission.begin());
    // Exporters write Ke 0 0 0 beside a map_Ke, as they write Kd beside map_Kd.
    if (!out.emission_texture.name.empty()) out.emission = {1, 1, 1};
  }
  aiString mode;
  if (from.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) != aiReturn_SUCCESS) return out;
  const std::string is = mode.C_Str();
  out.alpha = is == "MASK" ? AlphaMode::mask : is == "BLEND" ? AlphaMode::blend : AlphaMode::none;
  if (is == "MASK") from.Get(AI_MATKEY_GLTF_ALPHACUTOFF, out.cutoff);
  if (!std::isfinite(out.cutoff)) fail_reading(Status::input, "", "a material's alphaCutoff is not finite");
  return out;
}

MeshCorner Teller::corner(const aiMesh& part, const MtlMaterial* mtl, unsigned i) const {
  MeshCorner c;
  c.position = {part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z};
  if (part.HasNormals()) c.normal = {part.mNormals[i].x, part.mNormals[i].y, part.mNormals[i].z};
  if (part.HasVertexColors(0)) {
    const aiColor4D& of = part.mColors[0][i];
    c.colour = {colour_scale_ * of.r, colour_scale_ * of.g, colour_scale_ * of.b, 1};
  }
  if (!part.HasTextureCoords(0)) return c;
  const aiVector3D& uv = part.mTextureCoords[0][i];
  const auto placed = [&](const MtlTexture& by) {
    return std::array<float, 2>{by.scale[0] * uv.x + by.offset[0], by.scale[1] * uv.y + by.offset[1]};
  };
  c.uv = placed(mtl ? mtl->diffuse : MtlTexture());
  c.emission_uv = placed(mtl ? mtl->emission : MtlTexture());
  return c;
}

// assimp gives a grey material to faces without one.
bool Teller::is_made_up(unsigned material) const {
  const std::string name = name_of(*scene_.mMaterials[material]);
  return name == AI_DEFAULT_MATERIAL_NAME && !mtl_.find(name);
}

void Teller::part(const aiMesh& part) {
  const unsigned white = scene_.mNumMaterials;  // appended by tell()
  const bool plain = part.HasVertexColors(0) && is_made_up(part.mMaterialIndex);
  teller_.part({part.mName.C_Str(), plain ? white : part.mMaterialIndex, part.HasTextureCoords(0)});
  const MtlMaterial* mtl = mtl_.find(name_of(*scene_.mMaterials[part.mMaterialIndex]));
  std::vector<std::array<float, 3>> places;
  for (unsigned f = 0; f < part.mNumFaces; ++f) {
    const aiFace& face = part.mFaces[f];
    if (face.mNumIndices < 3) continue;  // points and lines
    const auto say = [&](unsigned k) { teller_.corner(corner(part, mtl, face.mIndices[k]), face.mIndices[k]); };
    if (face.mNumIndices == 3) {
      for (unsigned k = 0; k < 3; ++k) say(k);
      continue;
    }
    places.clear();
    for (unsigned k = 0; k < face.mNumIndices; ++k) {
      const aiVector3D& at = part.mVertices[face.mIndices[k]];
      places.push_back({at.x, at.y, at.z});
    }
    for (const auto& triangle : triangulate(places))
      for (const std::uint32_t k : triangle) say(k);
  }
}

void Teller::tell() {
  for (const std::string& note : mtl_.notes()) library_.say(Kind::note, Packer().text(note.substr(0, 1000)));
  const float most = brightest(scene_);
  if (most > 1.01f && most < 255.5f) {
    colour_scale_ = 1 / 255.0f;
    library_.say(Kind::note,
                 Packer().text(fmt::format("its vertices' colours go up to {}: they are read as 0 to 255", most)));
  }
  std::vector<MeshMaterial> materials;
  for (unsigned i = 0; i < scene_.mNumMaterials; ++i) materials.push_back(material(*scene_.mMaterials[i]));
  materials.emplace_back();  // white, for parts that only have vertex colours
  teller_.materials(materials);
  for (unsigned i = 0; i < scene_.mNumMeshes; ++i) part(*scene_.mMeshes[i]);
  teller_.done();
}

}  // namespace

void read_with_assimp(const std::string& path, Library& library) {
  Assimp::Importer& importer = *new Assimp::Importer;  // never freed: the process exits before
  drop_other_importers(importer);
  MtlMaterials mtl;
  importer.SetIOHandler(new MeshFiles(library, mtl));  // the importer deletes it
  // Removes bones, cameras and the like, which would only be transformed.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                                          aiComponent_LIGHTS | aiComponent_CAMERAS |
                                                          aiComponent_TANGENTS_AND_BITANGENTS);
  const auto refuse_unread = [&](const aiScene* scene) {
    if (!scene)
      fail_reading(Status::format, "",
                   fmt::format("cannot be read as a mesh: {}", printable(importer.GetErrorString())));
  };
  const aiScene* scene = importer.ReadFile(path, 0);
  if (mtl.refused()) throw *mtl.refused();
  mtl.note_unknown();
  refuse_unread(scene);
  check_faces(*importer.GetScene());
  refuse_unread(importer.ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_PreTransformVertices));
  Teller(*importer.GetScene(), mtl, library).tell();
}

}  // namespace vsplat::read
