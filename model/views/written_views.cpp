#include "model/views/written_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "model/io/picture/image_file.h"
#include "model/io/views/cameras_json.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Folds case, because some file systems ignore it.
std::string folded(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

std::vector<std::string> picture_names(const std::vector<PreparedView>& views) {
  std::vector<std::string> stems;
  std::set<std::string> seen;
  for (const PreparedView& view : views) {
    const std::string stem = fs::path(view.camera.file).stem().string();
    stems.push_back(stem.empty() ? "view" : stem);
    seen.insert(folded(stems.back()));
  }
  const bool unique = seen.size() == views.size();
  for (std::size_t i = 0; i < stems.size(); ++i)
    stems[i] = unique ? stems[i] + ".png" : fmt::format("{:04}_{}.png", i, stems[i]);
  return stems;
}

}  // namespace

std::vector<std::string> written_view_files(const std::string& folder, const std::vector<PreparedView>& views) {
  std::vector<std::string> out;
  for (const std::string& name : picture_names(views)) out.push_back((fs::path(folder) / name).string());
  out.push_back((fs::path(folder) / "cameras.json").string());
  return out;
}

void write_views(const std::string& folder, const std::vector<PreparedView>& views) {
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (problem) fail(Status::file, "{}: the folder cannot be made: {}", folder, problem.message());
  const std::vector<std::string> names = picture_names(views), files = written_view_files(folder, views);
  std::vector<Camera> cameras;
  std::size_t written = 0;
  try {
    for (; written < views.size(); ++written) {
      write_png(files[written], views[written].image);
      cameras.push_back(views[written].camera);
      cameras.back().file = names[written];
    }
    write_cameras(files.back(), cameras);
  } catch (...) {
    for (std::size_t i = 0; i < written; ++i) fs::remove(files[i], problem);
    throw;
  }
}

}  // namespace vsplat
