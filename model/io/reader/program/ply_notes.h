// Reports what assimp ignores in a PLY mesh.
#pragma once
#include <string>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

// Reads the file's header and notes what changes the picture but is not read: colours of faces, and vertex colours
// under unusual names. Wrong(input) if the header names several textures.
void note_ply_header(const std::string& path, Library& library);

}  // namespace vsplat::read
