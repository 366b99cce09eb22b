// Parts of a mesh left out, its triangles reduced, its normals.
#pragma once
#include <cstddef>

#include "model/base/surface_mesh.h"

namespace vsplat {

// Removes connected parts whose area is less than `share` of the largest part's.
void drop_small_parts(SurfaceMesh& mesh, double share);
// Collapses edges where that changes the surface least (quadric errors), until there are at most `most` triangles.
void reduce_triangles(SurfaceMesh& mesh, std::size_t most);
// The mean normal of a vertex's triangles, weighted by area.
void compute_normals(SurfaceMesh& mesh);

}  // namespace vsplat
