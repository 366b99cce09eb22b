// The sparse points that belong to listed views.
#pragma once
#include <optional>
#include <vector>

#include "model/io/views/colmap_points.h"
#include "model/io/views/view_set.h"

namespace vsplat {

struct ListedPoints {
  std::vector<ColoredPoint> points;  // in the views' world
  std::filesystem::path file;
  // Whether the points are known to be in the views' world. False for points of a COLMAP model that has too few
  // pictures named in the list; they are then in that model's world.
  bool placed = true;
};

// For a COLMAP model, its own points. For other lists, the file named by ply_file_path, else the points of a COLMAP
// model in the same folder, transformed to the list's world by the cameras with equal names (nerfstudio rotates and
// scales COLMAP's world). Nothing if there is no such file. Errors as read_colmap_points(); Error(input) if the cameras
// with equal names do not match.
std::optional<ListedPoints> listed_points(const ViewSet& set);

}  // namespace vsplat
