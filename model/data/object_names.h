// Names the objects of a data set.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

// Names for mesh files: the file's stem, or its folder's name if stems repeat or are `model`; then numbered().
std::vector<std::string> object_names(const std::vector<std::string>& files);

// Makes names unique: the second of equal names becomes NAME_2, the third NAME_3, skipping names that exist.
std::vector<std::string> numbered(std::vector<std::string> names);

// The last component of a folder's path, however it is written ("set/", ".", "set/../cup").
std::string folder_name(const std::string& folder);

}  // namespace vsplat
