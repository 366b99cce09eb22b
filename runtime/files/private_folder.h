// A folder that nobody else may write into, as the cache's has to be.
#pragma once
#include <string>

namespace vsplat {

// With those above it, where they are missing; what is there stays as it is. Error(file).
void make_private_folder(const std::string& path);

}  // namespace vsplat
