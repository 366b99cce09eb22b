// A mesh in a file: glTF 2.0 by gltf.h, the rest by assimp.h.
#pragma once
#include "model/io/reader/program/library.h"

namespace vsplat::read {

// Tells the library its materials, then part by part its triangles, all in place. Wrong where it cannot be read.
void read_mesh(const std::string& path, Library& library);

}  // namespace vsplat::read
