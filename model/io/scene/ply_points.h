// Sparse points in a PLY file, as nerfstudio's ply_file_path names one.
#pragma once
#include <string>
#include <vector>

#include "model/io/views/colmap_points.h"

namespace vsplat {

// The vertices, in the file's order: x, y, z and, where there are any, red, green and blue; grey without. Nothing says
// how well they were measured: error is negative and track 0. Error(file) where there is no such file, Error(format)
// where it is damaged or its vertices have no x, y, z, Error(input) where a position is not finite or no vertex is
// listed.
std::vector<ColoredPoint> read_ply_points(const std::string& path);

}  // namespace vsplat
