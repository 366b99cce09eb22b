#include "runtime/private_folder.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "runtime/fail.h"

namespace vsplat {

void make_private_folder(const std::string& path) {
  const std::filesystem::path folder(path);
  std::error_code error;
  if (path.empty() || std::filesystem::is_directory(folder, error)) return;
  make_private_folder(folder.parent_path().string());
  if (::mkdir(path.c_str(), 0700) != 0 && errno != EEXIST)
    fail(Status::file, "{}: the folder cannot be made: {}", path, std::strerror(errno));
}

}  // namespace vsplat
