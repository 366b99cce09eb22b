// The pictures of a folder, and which of them belongs to a camera.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace vsplat {

// The picture (.png, .jpg, .jpeg, .exr) of `folder` with the stem of `name`, whatever folders `name` is listed with;
// where `folder` has the folder of `name` inside, it is looked for there. A file called exactly as listed comes first.
// "" where there is none; Error(input) where several have the stem, Error(file) where the folder cannot be read.
std::filesystem::path find_picture(const std::filesystem::path& folder, const std::filesystem::path& name);

// The files that are called like pictures, not those of folders in it, in order of name. Error(file) where the folder
// cannot be read.
std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);

}  // namespace vsplat
