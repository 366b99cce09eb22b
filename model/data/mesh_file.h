// Meshes in files: OBJ, PLY, STL, glTF and GLB.
#pragma once
#include <string>

#include "model/data/mesh.h"

namespace vsplat {

// The file's mesh with all its parts in place, in the file's coordinates, textures read, normals computed where the
// file has none. `texture`, where not empty, is a picture that covers every part instead of the file's own textures
// and colours. Alpha is ignored: surfaces are opaque, and seen from both sides.
// The file is read in another process (model/io/reader/README.md).
// Error(file) where it cannot be opened, Error(format) where it cannot be read, takes more time or memory than a file
// of its size should or an index is out of range, Error(input) where it is of another kind, has no faces, a coordinate
// is not finite, a material file or texture that it names is missing, or a part is to be textured and has no texture
// coordinates.
Mesh load_mesh(const std::string& path, const std::string& texture = "");

}  // namespace vsplat
