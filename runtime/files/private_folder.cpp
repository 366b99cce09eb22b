#include "runtime/files/private_folder.h"

#include <filesystem>

#include "runtime/fail.h"
#include "runtime/system/system.h"

namespace vsplat {

void make_private_folder(const std::string& path) {
  const std::filesystem::path folder(path);
  std::error_code error;
  if (path.empty() || std::filesystem::is_directory(folder, error)) return;
  make_private_folder(folder.parent_path().string());
  error = sys::make_folder(folder, sys::Whose::owner);
  if (error && error != std::errc::file_exists)
    fail(Status::file, "{}: the folder cannot be made: {}", path, error.message());
}

}  // namespace vsplat
