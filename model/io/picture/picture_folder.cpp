#include "model/io/picture/picture_folder.h"

#include <algorithm>

#include "model/io/views/listed_file.h"
#include "runtime/fail.h"

namespace vsplat {
namespace fs = std::filesystem;

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) fail(Status::file, "{}: no such folder of pictures", folder.string());
  std::vector<fs::path> out;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (has_picture_ending(entry->path()) && entry->is_regular_file(ignored)) out.push_back(entry->path());
  }
  if (error) fail(Status::file, "{}: the folder cannot be read: {}", folder.string(), error.message());
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace vsplat
