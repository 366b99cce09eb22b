// The cache folders for compiled kernels, and whether they can be written.
#pragma once
#include <cstddef>
#include <string>
#include <system_error>

namespace vsplat {

struct CacheFolder {
  std::string path;      // "": caching is off
  std::string variable;  // environment variable that decides so; "": none
};
// The library's own; see disk_cache.h.
CacheFolder own_cache();
// PoCL's cache folder. PoCL offers no device if it cannot create that folder.
CacheFolder pocl_cache();

// Whether a file of so many bytes can be created in the folder or, if it does not exist, in the nearest existing one
// above.
std::error_code try_writing(const std::string& folder, std::size_t bytes = 0);
bool is_writable(const std::string& folder);

}  // namespace vsplat
