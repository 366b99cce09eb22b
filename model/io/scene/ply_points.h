// Sparse points in a PLY file, such as nerfstudio's ply_file_path.
#pragma once
#include <string>
#include <vector>

#include "model/io/views/colmap_points.h"

namespace vsplat {

// The vertices in file order: x, y, z and, if present, red, green and blue; otherwise grey. Measurement quality is
// unknown: error is negative and track 0. Error(file) if the file does not exist, Error(format) if it is damaged or its
// vertices have no x, y, z, Error(input) if a position is not finite or no vertex is listed.
std::vector<ColoredPoint> read_ply_points(const std::string& path);

}  // namespace vsplat
