// Lists the pictures in a folder.
#pragma once
#include <filesystem>
#include <vector>

namespace vsplat {

// The files with a picture's ending, sorted by name, without subfolders. Error(file) if the folder cannot be read.
std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);

}  // namespace vsplat
