#include "model/io/reader/program/read_mesh.h"

#include <algorithm>
#include <cctype>

#include "model/io/reader/program/assimp.h"
#include "model/io/reader/program/gltf.h"
#include "model/io/reader/program/ply_notes.h"

namespace vsplat::read {
namespace {

bool ends_with(std::string path, const std::string& ending) {
  std::transform(path.begin(), path.end(), path.begin(), [](unsigned char c) { return std::tolower(c); });
  return path.ends_with(ending);
}

}  // namespace

void read_mesh(const std::string& path, Library& library) {
  if (ends_with(path, ".ply")) note_ply_header(path, library);
  const bool gltf = ends_with(path, ".gltf") || ends_with(path, ".glb");
  if (!gltf || !read_gltf(path, library)) read_with_assimp(path, library);
}

}  // namespace vsplat::read
