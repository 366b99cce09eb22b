// Locates the pictures and masks of a list of views, with listed_file.h.
#pragma once
#include <filesystem>

#include "model/io/views/view_set.h"
#include "runtime/files/roots.h"

namespace vsplat {

// Fills in ListedView::picture, mask and depth, and ViewSet::looked_for if a picture is missing. `given`: the path that
// the user named. Adds to `roots` the folders of a COLMAP model's pictures and masks.
// Error(input) if two files match a name equally well, or if two views would share a file that was found for at least
// one of them by an inexact match; if the options use no pictures, it finds none instead.
void find_view_files(ViewSet& set, const std::filesystem::path& given, const ReadOptions& options, Roots& roots);

}  // namespace vsplat
