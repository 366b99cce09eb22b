// Writes meshes with a colour at each vertex: binary PLY and GLB (glTF 2.0).
#pragma once
#include <string>

#include "model/base/surface_mesh.h"

namespace vsplat {

// Whether write_mesh() knows the ending, in any case: .ply or .glb.
bool is_mesh_name(const std::string& path);

// PLY: positions in the world (doubles if the mesh has an offset), normals, 8-bit sRGB colours. GLB: in glTF's axes, as
// write_glb_scene() turns scenes (x, y and z become -x, -y and z), linear 16-bit colours, unlit; the offset is the
// node's. Error(usage) for another ending.
void write_mesh(const std::string& path, const SurfaceMesh& mesh);

}  // namespace vsplat
