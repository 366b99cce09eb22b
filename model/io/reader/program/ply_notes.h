// What assimp passes over in a PLY mesh.
#pragma once
#include <string>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

// Notes, by the file's header, what changes the picture and is not read: colours of faces, and of vertices under names
// that are not those of colours. Wrong(input) where it names several textures.
void note_ply_header(const std::string& path, Library& library);

}  // namespace vsplat::read
