// A folder that other users may not write into, as the cache requires.
#pragma once
#include <string>

namespace vsplat {

// Creates the folder and its missing parents; existing ones stay unchanged. Error(file).
void make_private_folder(const std::string& path);

}  // namespace vsplat
