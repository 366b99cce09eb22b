#include "model/io/views/view_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "model/io/any_case.h"
#include "model/io/views/listed_file.h"
#include "runtime/error.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

bool is_a_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}
bool is_a_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}
fs::path or_here(const fs::path& folder) { return folder.empty() ? fs::path(".") : folder; }

// The folder and up to three parent folders.
std::vector<fs::path> folder_and_above(const fs::path& folder) {
  std::error_code error;
  const fs::path real = fs::canonical(folder, error);
  std::vector<fs::path> out = {folder};
  fs::path up = folder;
  for (fs::path at = error ? folder : real; out.size() < 4 && at.has_parent_path() && at != at.parent_path();
       at = at.parent_path()) {
    up /= "..";
    out.push_back(up.lexically_normal());
  }
  return out;
}

// Where a COLMAP model's pictures may be, the likeliest first. Those of a model in distorted/ are in input/, because
// images/ holds the undistorted ones.
std::vector<fs::path> picture_places(const ViewSet& set, const std::vector<fs::path>& around) {
  std::vector<const char*> names = {"images", "input", "images_2", "images_4", "images_8"};
  for (const fs::path& part : set.source)
    if (part == "distorted") std::swap(names[0], names[1]);
  std::vector<fs::path> out;
  for (const char* name : names)
    for (const fs::path& folder : around)
      if (const fs::path place = in_any_case(folder, name); is_a_folder(place)) out.push_back(place);
  out.insert(out.end(), around.begin(), around.begin() + std::min<std::ptrdiff_t>(std::ssize(around), 3));
  return out;
}

// The file found for each view, and the number of views with a file.
struct Search {
  std::vector<FoundFile> files;
  std::size_t count = 0;
};

Search search(const ViewSet& set, ListedFiles& where) {
  Search out;
  for (const ListedView& view : set.views) {
    out.files.push_back(view.problem.empty() ? where.find(view.name) : FoundFile{});
    out.count += !out.files.back().path.empty();
  }
  return out;
}

// A file found by an inexact match must belong to one view only, so that no picture is used for another.
void refuse_shared(const ViewSet& set, const std::vector<FoundFile>& files, const char* what) {
  std::map<fs::path, std::size_t> first;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (files[i].path.empty()) continue;
    const auto [other, is_new] = first.emplace(files[i].path.lexically_normal(), i);
    if (is_new || set.views[other->second].name == set.views[i].name) continue;
    if (files[i].exactly && files[other->second].exactly) continue;
    fail(Status::input,
         "{}: frames {} ({}) and {} ({}) would share the {} {}: the ends of both paths match it, but neither lists it "
         "exactly; keep the folders of the list",
         set.source.string(), other->second, printable(set.views[other->second].name), i, printable(set.views[i].name),
         what, printable(files[i].path.string()));
  }
}

void take_pictures(ViewSet& set, const Search& found, ListedFiles& where) {
  refuse_shared(set, found.files, "picture");
  for (std::size_t i = 0; i < set.views.size(); ++i) {
    ListedView& view = set.views[i];
    view.picture = found.files[i].path;
    if (view.picture.empty()) {
      if (set.looked_for.empty() && view.problem.empty() && !view.name.empty())
        set.first_missing = view.name, set.looked_for = where.where_looked(view.name);
      continue;
    }
    // The path is written with backslashes, as on Windows.
    if (view.picture.string().find('\\') != std::string::npos) continue;
    std::replace(view.name.begin(), view.name.end(), '\\', '/');
    view.camera.file = view.name;
  }
}

// COLMAP lists names relative to one folder: uses the first folder that has most of them. Returns it, or "" if none has
// any.
fs::path find_colmap_pictures(ViewSet& set, const ReadOptions& options, const std::vector<fs::path>& around,
                              Roots& roots) {
  std::vector<fs::path> places;
  if (options.pictures_dir.empty())
    places = picture_places(set, around);
  else
    places = {options.pictures_dir};
  std::optional<ListedFiles> best;
  Search most;
  fs::path folder;
  for (const fs::path& place : places) {
    std::optional<fs::path> written;
    if (options.pictures_dir.empty()) written = place;
    ListedFiles here({place}, written);
    Search found = search(set, here);
    if (best && found.count <= most.count) continue;
    best.emplace(std::move(here)), most = std::move(found), folder = place;
    if (most.count == set.views.size()) break;
  }
  if (most.count == 0) {
    ListedFiles everywhere(places);
    for (const ListedView& view : set.views)
      if (view.problem.empty() && set.looked_for.empty())
        set.first_missing = view.name, set.looked_for = everywhere.where_looked(view.name);
    return options.pictures_dir;
  }
  roots.add(folder);
  take_pictures(set, most, *best);
  if (options.pictures_dir.empty() && options.need_pictures && folder.filename() != "images")
    info("{}: its pictures are read from {}, which has {} of {}", set.source.string(),
         or_here(folder.lexically_normal()).string(), most.count, set.views.size());
  return folder;
}

void find_listed_pictures(ViewSet& set, const ReadOptions& options, Roots& roots) {
  const fs::path beside = set.source.parent_path();
  std::vector<fs::path> places = {options.pictures_dir};
  std::optional<fs::path> written;
  if (options.pictures_dir.empty()) places = {beside, in_any_case(beside, "images")}, written = beside;
  ListedFiles where(places, written, &roots);
  take_pictures(set, search(set, where), where);
}

// Searches masks/: the picture's name with .png replacing or following its ending, as COLMAP uses, or as for any listed
// file.
FoundFile mask_in(const fs::path& masks, ListedFiles& where, const std::string& name) {
  fs::path by_stem = masks / fs::path(name).replace_extension(".png"), by_name = masks / (name + ".png");
  if (fs::path(name).is_relative() && is_a_file(by_stem)) return {by_stem, true};
  if (fs::path(name).is_relative() && is_a_file(by_name)) return {by_name, true};
  const FoundFile found = where.find(name);
  return found.path.empty() ? where.find(name + ".png") : found;
}

// Takes the masks of a list that names none. If the folder has masks of some pictures, those of the others are missing.
void take_masks_of(ViewSet& set, const fs::path& masks, bool tell, Roots& roots) {
  ListedFiles where({masks});
  std::vector<FoundFile> files;
  std::size_t with_picture = 0, found = 0;
  for (const ListedView& view : set.views) {
    files.push_back(view.picture.empty() ? FoundFile{} : mask_in(masks, where, view.name));
    with_picture += !view.picture.empty();
    found += !files.back().path.empty();
  }
  if (with_picture == 0) return;
  const std::string folder = or_here(masks.lexically_normal()).string();
  const bool is_colmap = is_a_folder(set.source);
  if (found == 0 && !tell) return;
  if (found == 0 && !is_colmap) {
    warn("{}: the folder {} is not used: none of its files has the name of a listed picture", set.source.string(),
         folder);
    return;
  }
  refuse_shared(set, files, "mask");
  roots.add(masks);
  for (std::size_t i = 0; i < files.size(); ++i)
    if (!set.views[i].picture.empty())
      set.views[i].mask =
          files[i].path.empty() ? masks / fs::path(set.views[i].name).replace_extension(".png") : files[i].path;
  set.masks_found = fmt::format("{} of {} pictures have a mask in {}", found, with_picture, folder);
  if (found == with_picture && !is_colmap && tell)
    info("{}: {}; these masks are used", set.source.string(), set.masks_found);
}

// Masks as listed, relative to the list or, if the pictures are elsewhere, to the pictures.
void find_listed_masks(ViewSet& set, const ReadOptions& options, Roots& roots) {
  const fs::path beside = set.source.parent_path();
  std::vector<fs::path> places = {beside};
  if (!options.pictures_dir.empty()) {
    places.push_back(options.pictures_dir);
    places.push_back((options.pictures_dir / "../masks").lexically_normal());
    roots.add(places.back());
  }
  ListedFiles where(places, beside, &roots);
  std::vector<FoundFile> files;
  for (const ListedView& view : set.views) files.push_back(view.mask ? where.find(view.mask->string()) : FoundFile{});
  refuse_shared(set, files, "mask");
  for (std::size_t i = 0; i < files.size(); ++i)
    if (set.views[i].mask) set.views[i].mask = files[i].path.empty() ? beside / *set.views[i].mask : files[i].path;
}

// Depth pictures exactly as listed, relative to the list: a picture that is found by the end of its path could be the
// photograph.
void find_listed_depths(ViewSet& set, Roots& roots) {
  const fs::path beside = set.source.parent_path();
  ListedFiles where({beside}, beside, &roots);
  for (ListedView& view : set.views) {
    if (view.depth.empty()) continue;
    const FoundFile found = where.find(view.depth.string());
    view.depth = found.exactly && !found.path.empty() ? found.path : beside / view.depth;
  }
}

// Finds the pictures. Returns the folders that may contain a folder of masks.
std::vector<fs::path> find_pictures(ViewSet& set, const fs::path& given, const ReadOptions& options, Roots& roots) {
  if (is_a_folder(set.source)) {
    std::vector<fs::path> around = folder_and_above(set.source), out;
    if (is_a_folder(given) && std::find(around.begin(), around.end(), given) == around.end()) around.push_back(given);
    const fs::path pictures = find_colmap_pictures(set, options, around, roots);
    if (!pictures.empty()) out.push_back((pictures / "..").lexically_normal());
    out.insert(out.end(), around.begin(), around.end());
    return out;
  }
  find_listed_pictures(set, options, roots);
  std::vector<fs::path> out = {set.source.parent_path()};
  if (!options.pictures_dir.empty()) out.push_back((options.pictures_dir / "..").lexically_normal());
  return out;
}

void find_masks(ViewSet& set, const std::vector<fs::path>& mask_places, const ReadOptions& options, Roots& roots) {
  if (set.lists_masks) return find_listed_masks(set, options, roots);
  for (const fs::path& place : mask_places)
    for (const char* name : {"masks", "mask"})
      if (const fs::path masks = in_any_case(place, name); is_a_folder(masks)) {
        take_masks_of(set, masks, options.use_pictures, roots);
        return;
      }
}

}  // namespace

void find_view_files(ViewSet& set, const fs::path& given, const ReadOptions& options, Roots& roots) {
  // Target cameras only need a picture's size, and for comparisons its mask. If a name matches several files, it counts
  // as missing for them.
  const auto attempt = [&](const std::function<void(ViewSet&)>& find) {
    ViewSet with_files = set;
    try {
      find(with_files);
    } catch (const Error& error) {
      if (options.use_pictures || error.status() != Status::input) throw;
      verbose("{}", error.what());
      return;
    }
    set = std::move(with_files);
  };
  std::vector<fs::path> mask_places;
  attempt([&](ViewSet& with) { mask_places = find_pictures(with, given, options, roots); });
  attempt([&](ViewSet& with) { find_masks(with, mask_places, options, roots); });
  if (options.use_pictures) find_listed_depths(set, roots);
}

}  // namespace vsplat
