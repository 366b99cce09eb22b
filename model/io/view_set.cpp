#include "model/io/view_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "model/io/cameras_json.h"
#include "model/io/colmap.h"
#include "model/io/transforms_json.h"
#include "model/io/view_checks.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"
#include "runtime/roots.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}
bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

// The folder and the up to two above it.
std::vector<fs::path> folder_and_above(const fs::path& folder) {
  std::error_code error;
  const fs::path real = fs::canonical(folder, error);
  std::vector<fs::path> out = {folder};
  fs::path up = folder;
  for (fs::path at = error ? folder : real; out.size() < 3 && at.has_parent_path() && at != at.parent_path();
       at = at.parent_path()) {
    up /= "..";
    out.push_back(up.lexically_normal());
  }
  return out;
}

// COLMAP: images/ beside the model or up to two folders above it, masks/ beside that folder.
void find_colmap_pictures(ViewSet& set, const ReadOptions& options, Roots& roots) {
  const std::vector<fs::path> around = folder_and_above(set.source);
  fs::path pictures = options.pictures_dir, masks;
  for (const fs::path& folder : around)
    if (pictures.empty() && is_folder(folder / "images")) pictures = folder / "images";
  if (pictures.empty()) {
    if (!options.need_pictures) return;
    fail(Status::file,
         "{}: no folder images/ beside the model or up to two folders above it; give vsplat_views_load their folder",
         set.source.string());
  }
  std::vector<fs::path> beside = around;
  beside.insert(beside.begin(), (pictures / "..").lexically_normal());
  for (const fs::path& folder : beside)
    if (masks.empty() && is_folder(folder / "masks")) masks = folder / "masks";
  roots.add(pictures);
  roots.add(masks);
  for (ListedView& view : set.views) {
    if (is_file(pictures / view.name)) view.picture = pictures / view.name;
    if (masks.empty()) continue;
    const fs::path by_stem = masks / fs::path(view.name).replace_extension(".png");
    const fs::path by_name = masks / (view.name + ".png");  // as COLMAP itself reads them
    view.mask = !is_file(by_stem) && is_file(by_name) ? by_name : by_stem;
  }
}

// Names relative to the file, or to --pictures with or without their first folder; an extension left out is found.
void find_listed_pictures(ViewSet& set, const ReadOptions& options) {
  const fs::path beside = set.source.parent_path();
  for (ListedView& view : set.views) {
    if (view.name.empty()) continue;
    const fs::path name = view.name;
    std::vector<fs::path> places;
    if (options.pictures_dir.empty() || name.is_absolute()) {
      places.push_back(beside / name);
      if (set.convention == PoseConvention::opencv_position) places.push_back(beside / "images" / name);
    } else {
      places.push_back(options.pictures_dir / name);
      const fs::path normal = name.lexically_normal();
      if (std::distance(normal.begin(), normal.end()) > 1)
        places.push_back(options.pictures_dir / normal.lexically_relative(*normal.begin()));
    }
    std::vector<const char*> endings = {"", ".png"};
    if (set.convention == PoseConvention::opencv_position)
      endings.insert(endings.end(), {".jpg", ".jpeg", ".JPG", ".tif", ".webp", ".bmp"});
    for (const fs::path& place : places)
      for (const char* ending : endings)
        if (view.picture.empty() && is_file(place.string() + ending)) view.picture = place.string() + ending;
  }
}

void count_pictures(const ViewSet& set) {
  std::size_t missing = 0;
  const ListedView* first = nullptr;
  for (const ListedView& view : set.views) {
    if (!view.picture.empty()) continue;
    ++missing;
    if (!first) first = &view;
  }
  if (missing == 0) return;
  if (missing == set.views.size())
    fail(Status::input, "{}: none of the {} pictures listed is there, {} first; give vsplat_views_load their folder",
         set.source.string(), missing, printable(first->name));
  warn("{}: {} of {} listed frames have no picture and are skipped ({} first)", set.source.string(), missing,
       set.views.size(), printable(first->name));
}

void find_pictures(ViewSet& set, const ReadOptions& options, Roots& roots) {
  if (is_folder(set.source))
    find_colmap_pictures(set, options, roots);
  else
    find_listed_pictures(set, options);
}

// Files made on Windows list paths with backslashes: taken for slashes where there is a file of that name, and none
// with backslashes in its name.
void turn_backslashes(ViewSet& set, const ReadOptions& options, Roots& roots) {
  const auto turned = [](std::string path) {
    std::replace(path.begin(), path.end(), '\\', '/');
    return path;
  };
  for (ListedView& view : set.views) {
    if (view.mask && !is_file(*view.mask) && is_file(turned(view.mask->string())))
      view.mask = turned(view.mask->string());
    if (!view.picture.empty() || view.name.find('\\') == std::string::npos) continue;
    ViewSet one{{view}, {}, {}, set.source, set.convention};
    one.views[0].name = one.views[0].camera.file = turned(view.name);
    find_pictures(one, options, roots);
    if (!one.views[0].picture.empty()) view = one.views[0];
  }
}

// Whoever made the list may have been no friend: what it names is not read wherever it leads.
void refuse_outside(ViewSet& set, bool use_pictures, Roots& roots) {
  for (std::size_t i = 0; i < set.views.size(); ++i) {
    ListedView& view = set.views[i];
    const auto who = [&](const char* what) {
      return fmt::format("{}: frame {} ({}): its {}", set.source.string(), i, printable(view.name), what);
    };
    if (!use_pictures && !view.picture.empty() && !roots.hold(view.picture)) view.picture.clear();
    if (!view.picture.empty()) roots.need(view.picture, who("picture"));
    if (view.mask) roots.need(*view.mask, who("mask"));
  }
  if (!is_file(set.points) || !roots.hold(set.points)) set.points.clear();
}

ViewSet read_json_views(const fs::path& path, bool need_pictures) {
  const nlohmann::json root = read_json(path);
  if (root.is_array()) return parse_cameras_json(path, root, need_pictures);
  if (root.is_object() && root.contains("frames")) return parse_transforms_json(path, root, need_pictures);
  fail(Status::format, "{}: neither a transforms.json (an object with frames) nor a cameras.json (a list of cameras)",
       path.string());
}

// The file of cameras in a folder, or the folder of the COLMAP model; "" where there is neither.
fs::path find_cameras(const fs::path& folder) {
  for (const char* name : {"transforms.json", "cameras.json"})
    if (is_file(folder / name)) return folder / name;
  return find_colmap_model(folder);
}

ViewSet read_any(const fs::path& path, bool need_pictures) {
  std::error_code error;
  if (!fs::exists(path, error)) fail(Status::file, "{}: no such file or folder", path.string());
  if (!is_folder(path)) {
    const std::string name = path.filename().string();
    for (const char* part : {"cameras.bin", "images.bin", "cameras.txt", "images.txt"})
      if (name == part) return read_colmap(path.has_parent_path() ? path.parent_path() : fs::path("."));
    return read_json_views(path, need_pictures);
  }
  const fs::path found = find_cameras(path);
  if (!found.empty()) return is_file(found) ? read_json_views(found, need_pictures) : read_colmap(found);
  fail(Status::file,
       "{}: no cameras: transforms.json, cameras.json or a COLMAP model in sparse/0, sparse, colmap or the folder "
       "itself is "
       "expected",
       path.string());
}

}  // namespace

ViewSet read_views(const fs::path& path, const ReadOptions& options) {
  if (!options.pictures_dir.empty() && !is_folder(options.pictures_dir))
    fail(Status::file, "{}: no such folder of pictures", options.pictures_dir.string());
  ViewSet set = read_any(path, options.need_pictures);
  Roots roots;
  const fs::path beside = is_folder(set.source) ? set.source : set.source.parent_path();
  roots.add(beside.empty() ? "." : beside);
  if (is_folder(path)) roots.add(path);
  roots.add(options.pictures_dir);
  for (const fs::path& root : options.roots) roots.add(root);
  find_pictures(set, options, roots);
  turn_backslashes(set, options, roots);
  refuse_outside(set, options.use_pictures, roots);
  if (options.need_pictures) count_pictures(set);
  for (ListedView& view : set.views)
    if (view.camera.width > 0 && view.camera.height > 0)
      resolve_intrinsics(view, view.camera.width, view.camera.height);
  return set;
}

bool holds_views(const fs::path& folder) { return !find_cameras(folder).empty(); }

namespace {

// Of a picture that was resized: the same shape within a pixel.
void scale_to(Camera& c, const std::string& where, int listed_width, int listed_height, int width, int height) {
  const double x = static_cast<double>(width) / listed_width, y = static_cast<double>(height) / listed_height;
  const bool resized = std::abs(y * listed_width - width) < 1 || std::abs(x * listed_height - height) < 1;
  if (!resized)
    fail(Status::input, "{}: the picture is {} x {} pixels, its camera is listed with {} x {}{}", where, width, height,
         listed_width, listed_height,
         listed_width == height && listed_height == width ? ": it fits only after turning; turn the picture"
                                                          : ": it is no resized picture either, the shape differs");
  c.fx *= x, c.cx *= x, c.fy *= y, c.cy *= y;
}

}  // namespace

void resolve_intrinsics(ListedView& view, int width, int height) {
  Camera& c = view.camera;
  const std::string where = view.picture.empty() ? printable(view.name) : view.picture.string();
  if (width < 1 || height < 1 || width > max_picture_side || height > max_picture_side)
    fail(Status::input, "{}: a picture of {} x {} pixels is not possible", where, width, height);
  const int listed_width = c.width > 0 ? c.width : width, listed_height = c.height > 0 ? c.height : height;
  if (listed_width != width || listed_height != height) scale_to(c, where, listed_width, listed_height, width, height);
  c.width = width, c.height = height;
  if (std::isnan(c.fx)) {
    if (!std::isnan(view.angle_x)) c.fx = 0.5 * width / std::tan(0.5 * view.angle_x);
    if (!std::isnan(view.angle_y)) c.fy = 0.5 * height / std::tan(0.5 * view.angle_y);
    if (std::isnan(c.fx)) c.fx = c.fy;
    if (std::isnan(c.fy)) c.fy = c.fx;
  }
  if (std::isnan(c.cx)) c.cx = 0.5 * width;
  if (std::isnan(c.cy)) c.cy = 0.5 * height;
  check_intrinsics(where, c);
}

bool is_resolved(const ListedView& view) {
  const Camera& c = view.camera;
  return c.width > 0 && c.height > 0 && std::isfinite(c.fx) && std::isfinite(c.fy) && std::isfinite(c.cx) &&
         std::isfinite(c.cy);
}

}  // namespace vsplat
