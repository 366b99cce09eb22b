// The folders that compiled kernels are kept in, and whether they can be.
#pragma once
#include <string>

namespace vsplat {

struct CacheFolder {
  std::string path;      // "": nothing is kept
  std::string variable;  // of the environment, that says so; "": none does
};
// Ours; see disk_cache.h.
CacheFolder own_cache();
// Where PoCL keeps compiled kernels. It gives no device where it cannot make that folder.
CacheFolder pocl_cache();

// Whether the folder, or the nearest one above it that is there, takes a file.
bool is_writable(const std::string& folder);

}  // namespace vsplat
