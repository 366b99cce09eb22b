// The sparse points that come with listed views.
#pragma once
#include <optional>
#include <vector>

#include "model/io/views/colmap_points.h"
#include "model/io/views/view_set.h"

namespace vsplat {

struct ListedPoints {
  std::vector<ColoredPoint> points;  // in the views' world
  std::filesystem::path file;
  // Whether they are known to be of the views' world. Not where they are a COLMAP model's that has no picture of the
  // list's names: then they are as that model has them.
  bool placed = true;
};

// Of a COLMAP model its own; of other lists the file that ply_file_path names, else those of a COLMAP model in the same
// folder, moved into the list's world by the cameras of equal names (nerfstudio turns and scales COLMAP's world).
// Nothing where there is no such file. Errors as read_colmap_points(); Error(input) where cameras of equal names have
// nothing to do with each other.
std::optional<ListedPoints> listed_points(const ViewSet& set);

}  // namespace vsplat
