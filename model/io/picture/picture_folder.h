// The pictures of a folder.
#pragma once
#include <filesystem>
#include <vector>

namespace vsplat {

// The files that are called like pictures, not those of folders in it, in order of name. Error(file) where the folder
// cannot be read.
std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);

}  // namespace vsplat
