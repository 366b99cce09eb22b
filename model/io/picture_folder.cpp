#include "model/io/picture_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "runtime/fail.h"
#include "runtime/roots.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

bool is_picture(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const std::array<const char*, 8> known = {".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff", ".webp", ".bmp"};
  return std::find(known.begin(), known.end(), ending) != known.end();
}

// `folder`, or that of `name` inside it.
fs::path place_of(const fs::path& folder, const fs::path& name) {
  const fs::path listed = name.parent_path().lexically_normal();
  std::error_code error;
  const bool inside = !listed.empty() && listed.is_relative() && *listed.begin() != "..";
  return inside && fs::is_directory(folder / listed, error) ? folder / listed : folder;
}

}  // namespace

fs::path find_picture(const fs::path& folder, const fs::path& name) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) fail(Status::file, "{}: no such folder of pictures", folder.string());
  Roots roots;
  roots.add(folder);
  const fs::path place = place_of(folder, name), file = name.filename();
  // An INRIA file lists names without an ending, in which a dot is nothing special.
  const fs::path stem = is_picture(file) ? file.stem() : file;
  std::vector<fs::path> found;
  fs::directory_iterator entry(place, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const fs::path& path = entry->path();
    std::error_code ignored;
    if (!is_picture(path) || path.stem() != stem || !entry->is_regular_file(ignored)) continue;
    if (path.filename() == file) {
      roots.need(path, fmt::format("{}: the camera's picture", folder.string()));
      return path;
    }
    found.push_back(path);
  }
  if (error) fail(Status::file, "{}: the folder cannot be read: {}", place.string(), error.message());
  std::sort(found.begin(), found.end());
  if (found.size() > 1)
    fail(Status::input, "{}: {} and {} both fit the camera's picture {}: keep one of them", place.string(),
         found[0].filename().string(), found[1].filename().string(), name.string());
  if (found.empty()) return {};
  roots.need(found.front(), fmt::format("{}: the camera's picture", folder.string()));
  return found.front();
}

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) fail(Status::file, "{}: no such folder of pictures", folder.string());
  std::vector<fs::path> out;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (is_picture(entry->path()) && entry->is_regular_file(ignored)) out.push_back(entry->path());
  }
  if (error) fail(Status::file, "{}: the folder cannot be read: {}", folder.string(), error.message());
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace vsplat
