// What the objects of a data set are called.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

// For the files of their meshes: a file's stem, or its folder's name where stems repeat or are `model`; numbered().
std::vector<std::string> object_names(const std::vector<std::string>& files);

// Of names that are equal, the second becomes NAME_2, the third NAME_3, passing over names that are there.
std::vector<std::string> numbered(std::vector<std::string> names);

// The last part of a folder's path, however it is written ("set/", ".", "set/../cup").
std::string folder_name(const std::string& folder);

}  // namespace vsplat
