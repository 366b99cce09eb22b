// A COLMAP sparse model: cameras and images, binary (preferred) or text. Its points are read by
// colmap_points.h; rigs and frames are not read.
#pragma once
#include "model/io/views/view_set.h"

namespace vsplat {

// Whether the folder holds cameras and images, .bin or .txt.
bool is_colmap_model(const std::filesystem::path& folder);

struct ColmapChoice {
  std::filesystem::path folder;  // "": there is no model
  std::string told = {};         // why this one, where there are several
};

// The model in sparse/, colmap/, colmap/sparse/, the folder itself, dense/sparse/, dense/N/sparse/ or
// distorted/sparse/, the first that is there. Where such a folder has several models in folders called by numbers, the
// one with the most images. Of a model nothing is read but how many images it has.
ColmapChoice choose_colmap_model(const std::filesystem::path& folder);
std::filesystem::path find_colmap_model(const std::filesystem::path& folder);

// The images in order of name; a camera is checked where an image is taken with it. ListedView::picture is left empty,
// and what is wrong with a single image becomes its problem.
ViewSet read_colmap(const std::filesystem::path& folder);

}  // namespace vsplat
