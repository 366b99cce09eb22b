// Reads meshes with assimp: OBJ, PLY, STL and glTF 1.0.
#pragma once
#include "model/io/reader/program/library.h"

namespace vsplat::read {

// As read_mesh().
void read_with_assimp(const std::string& path, Library& library);

}  // namespace vsplat::read
