// Which file or COLMAP model lists the cameras at a path, and reading it.
#pragma once
#include <filesystem>

#include "model/io/views/view_set.h"

namespace vsplat {

// What the list says; pictures and masks are not looked for. `path`: a file, or a folder with a transforms.json, else a
// cameras.json, else transforms_train.json, transforms_val.json and transforms_test.json, else a COLMAP model as
// choose_colmap_model() finds it. What was chosen of several is in ViewSet::choices. Error(file) where there is none
// says what lies there instead, and how to get cameras.
ViewSet read_view_list(const std::filesystem::path& path, const ReadOptions& options);

bool has_view_list(const std::filesystem::path& folder);

}  // namespace vsplat
