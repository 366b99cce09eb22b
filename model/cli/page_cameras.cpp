#include "page_cameras.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>

#include "command.h"
#include "comparison.h"
#include "data_uri.h"

namespace command {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_cameras = 200;
constexpr std::size_t few_cameras = 16;  // up to here the photographs are larger
constexpr int large = 640, small = 320;  // pixels of a photograph's longer side
constexpr int unknown_size = 512;        // for cameras whose list has none

// The folder that holds the list, or the one that was given.
std::string folder_of(const PageViews& views) {
  if (!views.pictures.empty()) return views.pictures;
  std::error_code error;
  if (fs::is_directory(views.cameras, error)) return views.cameras;
  const fs::path folder = fs::path(views.cameras).parent_path();
  return folder.empty() ? "." : folder.string();
}

// The photograph at about the size in which the page has it: decoding scales it down.
std::string photograph(const vsplat::Cameras& listed, std::size_t index, const std::string& file, int longest,
                       const PageViews& views) {
  std::int32_t width = 0, height = 0;
  listed.picture_size(index, file, width, height);
  const double scale = std::min(1.0, static_cast<double>(longest) / std::max(width, height));
  vsplat::Picture picture(std::max(1, static_cast<int>(width * scale)), std::max(1, static_cast<int>(height * scale)));
  picture.colour = listed.load_picture(index, file, picture.width, picture.height, views.background);
  return picture_uri(picture, longest);
}

}  // namespace

std::vector<PageCamera> page_cameras(const PageViews& views) {
  std::vector<PageCamera> out;
  if (views.cameras.empty()) return out;
  vsplat_cameras_options read = VSPLAT_CAMERAS_OPTIONS_INIT;
  read.width = read.height = unknown_size;
  read.skip_bad = 1;
  const vsplat::Cameras listed = vsplat::Cameras::load(views.cameras, read);
  const std::vector<vsplat_camera> all = listed.all();
  const std::size_t count = std::min(all.size(), most_cameras);
  const std::string folder = folder_of(views);
  std::size_t missing = 0;
  std::string first;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = k * all.size() / count;
    PageCamera& camera = out.emplace_back();
    camera.camera = all[i];
    camera.name = index_text(i);
    try {
      std::string file = views.pictures.empty() ? listed.find_picture(i) : "";
      if (file.empty()) file = listed.find_picture(i, folder);
      if (file.empty()) continue;
      camera.name = fs::path(file).filename().string();
      camera.picture = photograph(listed, i, file, count > few_cameras ? small : large, views);
    } catch (const vsplat::Error& e) {
      if (missing == 0) first = e.what();
      ++missing;
    }
  }
  if (missing)
    warn(views.cameras + ": " + std::to_string(missing) + " of " + std::to_string(count) +
         " photographs are not on the page; the first one: " + first);
  return out;
}

}  // namespace command
