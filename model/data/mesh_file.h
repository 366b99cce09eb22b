// Reads meshes from files: OBJ, PLY, STL, glTF and GLB.
#pragma once
#include <string>

#include "model/data/mesh.h"

namespace vsplat {

// Loads the mesh with all its parts in the file's coordinates, with textures; missing normals are computed. `texture`,
// if not empty, is a picture that covers every part and replaces the file's own textures and colours. Alpha is ignored:
// surfaces are opaque and visible from both sides.
// The file is read in another process (model/io/reader/README.md).
// Error(file) if it cannot be opened. Error(format) if it cannot be read, takes more time or memory than a file of its
// size should, or has an index out of range. Error(input) if it is of another kind, has no faces, has a coordinate that
// is not finite, refers to a missing material file or texture, or has a textured part without texture coordinates.
Mesh load_mesh(const std::string& path, const std::string& texture = "");

}  // namespace vsplat
