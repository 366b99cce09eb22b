// Locates the pictures and masks of a list of views, with listed_file.h.
#pragma once
#include <filesystem>

#include "model/io/views/view_set.h"
#include "runtime/files/roots.h"

namespace vsplat {

// Fills in ListedView::picture and mask, and ViewSet::looked_for where a picture is missing. `given`: the path that the
// user named. Adds to `roots` the folders in which a COLMAP model's pictures and masks are.
// Error(input) where two files fit a name alike, or two views would share a file that neither lists as it lies there;
// where no picture is used, there are none then.
void find_view_files(ViewSet& set, const std::filesystem::path& given, const ReadOptions& options, Roots& roots);

}  // namespace vsplat
