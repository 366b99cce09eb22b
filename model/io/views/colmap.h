// A COLMAP sparse model: cameras and images, binary (preferred) or text. colmap_points.h reads its points; rigs and
// frames are not read.
#pragma once
#include <string>

#include "model/io/views/view_set.h"

namespace vsplat {

// Whether the folder holds cameras and images, as .bin or .txt.
bool is_colmap_model(const std::filesystem::path& folder);

struct ColmapChoice {
  std::filesystem::path folder;  // "" if there is no model
  std::string reason = {};       // the reason for the choice, if there are several
};

// The first model found in sparse/, colmap/, colmap/sparse/, the folder itself, dense/sparse/, dense/N/sparse/ or
// distorted/sparse/. If that folder has several models in numbered subfolders, the one with the most images. Only the
// number of images is read from a model.
ColmapChoice choose_colmap_model(const std::filesystem::path& folder);
std::filesystem::path find_colmap_model(const std::filesystem::path& folder);

// The images sorted by name. A camera is checked if an image uses it. ListedView::picture stays empty, and an error in
// a single image becomes its problem.
ViewSet read_colmap(const std::filesystem::path& folder);

}  // namespace vsplat
