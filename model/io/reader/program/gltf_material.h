// The materials of a glTF file.
#pragma once
#include <set>
#include <vector>

#include "model/io/reader/program/gltf_file.h"
#include "model/io/reader/program/mesh_teller.h"

namespace vsplat::read {

// Where a texture lies on a surface: which of its texture coordinates, and how they are moved.
struct GltfPlacement {
  bool any = false;  // there is a texture
  std::size_t set = 0;
  double offset[2] = {0, 0}, scale[2] = {1, 1}, rotation = 0;

  // (0,0) of what comes is the texture's upper left, of what goes its lower left.
  std::array<float, 2> placed(const float* uv) const;
};

struct GltfMaterial {
  MeshMaterial material;
  GltfPlacement base, emission;
};

// Those that `used` names; the others stay plain, and whatever they hold is not looked at. The last one is the plain
// one, of parts without a material. Tells the pictures inside the file.
std::vector<GltfMaterial> read_materials(GltfFile& file, const std::set<std::size_t>& used, MeshTeller& teller);

}  // namespace vsplat::read
