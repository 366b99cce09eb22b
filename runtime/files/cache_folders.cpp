#include "runtime/files/cache_folders.h"

#include <filesystem>

#include "runtime/system/environment.h"
#include "runtime/system/system.h"

namespace vsplat {

namespace fs = std::filesystem;

CacheFolder own_cache() {
  if (const std::string own = environment("VSPLAT_CACHE_DIR"); !own.empty())
    return {own == "off" ? "" : own, "VSPLAT_CACHE_DIR"};
  if (const std::string xdg = environment("XDG_CACHE_HOME"); !xdg.empty()) return {xdg + "/vsplat", "XDG_CACHE_HOME"};
  if (const std::string home = environment("HOME"); !home.empty()) return {home + "/.cache/vsplat", "HOME"};
  return {};
}

CacheFolder pocl_cache() {
  if (const std::string own = environment("POCL_CACHE_DIR"); !own.empty()) return {own, "POCL_CACHE_DIR"};
  if (const std::string xdg = environment("XDG_CACHE_HOME"); !xdg.empty())
    return {xdg + "/pocl/kcache", "XDG_CACHE_HOME"};
  if (const std::string home = environment("HOME"); !home.empty()) return {home + "/.cache/pocl/kcache", "HOME"};
  return {"/tmp/pocl/kcache", ""};
}

namespace {

// The folder, or the nearest one above that exists.
fs::path nearest(fs::path folder) {
  std::error_code error;
  while (!fs::exists(folder, error) && folder.has_parent_path() && folder != folder.parent_path())
    folder = folder.parent_path();
  return folder;
}

}  // namespace

std::error_code try_writing(const std::string& folder, std::size_t bytes) {
  return sys::try_new_file_in(nearest(folder), bytes);
}

bool is_writable(const std::string& folder) { return !try_writing(folder); }

}  // namespace vsplat
