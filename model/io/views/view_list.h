// Finds the file or COLMAP model that lists the cameras at a path, and reads it.
#pragma once
#include <filesystem>

#include "model/io/views/view_set.h"

namespace vsplat {

// Reads the list; pictures and masks are not searched for. `path`: a file, or a folder with a transforms.json, else a
// cameras.json, else transforms_train.json, transforms_val.json and transforms_test.json, else a COLMAP model as found
// by choose_colmap_model(). ViewSet::choices reports a choice among several. If there is none, Error(file) says what is
// there instead and how to get cameras.
ViewSet read_view_list(const std::filesystem::path& path, const ReadOptions& options);

bool has_view_list(const std::filesystem::path& folder);

}  // namespace vsplat
