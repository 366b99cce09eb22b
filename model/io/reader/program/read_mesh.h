// Reads mesh files: glTF 2.0 with gltf.h, other formats with assimp.h.
#pragma once
#include "model/io/reader/program/library.h"

namespace vsplat::read {

// Sends the library the materials, then the triangles of each part, in scene coordinates. Throws Wrong if the file
// cannot be read.
void read_mesh(const std::string& path, Library& library);

}  // namespace vsplat::read
