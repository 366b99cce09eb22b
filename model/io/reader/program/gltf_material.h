// Reads the materials of a glTF file.
#pragma once
#include <set>
#include <vector>

#include "model/io/reader/program/gltf_file.h"
#include "model/io/reader/program/mesh_teller.h"

namespace vsplat::read {

// Placement of a texture on a surface: the set of texture coordinates and their transform.
struct GltfPlacement {
  bool any = false;  // the texture exists
  std::size_t set = 0;
  double offset[2] = {0, 0}, scale[2] = {1, 1}, rotation = 0;

  // Input has (0,0) at the texture's upper left, output at its lower left.
  std::array<float, 2> placed(const float* uv) const;
};

struct GltfMaterial {
  MeshMaterial material;
  GltfPlacement base, emission;
};

// Reads the materials in `used`; others stay plain, and their content is not checked. The last one is a plain material
// for parts without one. Sends the embedded pictures.
std::vector<GltfMaterial> read_materials(GltfFile& file, const std::set<std::size_t>& used, MeshTeller& teller);

}  // namespace vsplat::read
