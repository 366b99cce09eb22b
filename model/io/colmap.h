// A COLMAP sparse model: cameras and images, binary (preferred) or text. Its points are read by
// colmap_points.h; rigs and frames are not read.
#pragma once
#include "model/io/view_set.h"

namespace vsplat {

// Whether the folder holds cameras and images, .bin or .txt.
bool is_colmap_model(const std::filesystem::path& folder);

// The folder of the model in sparse/0, sparse, colmap or the folder itself, the first that is one; "" where none is.
std::filesystem::path find_colmap_model(const std::filesystem::path& folder);

// The images in order of name. ListedView::picture is left empty.
ViewSet read_colmap(const std::filesystem::path& folder);

}  // namespace vsplat
