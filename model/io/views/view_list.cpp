#include "model/io/views/view_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "model/io/any_case.h"
#include "model/io/foreign_file.h"
#include "model/io/views/cameras_json.h"
#include "model/io/views/colmap.h"
#include "model/io/views/listed_file.h"
#include "model/io/views/transforms_json.h"
#include "model/io/views/view_checks.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr std::pair<const char*, Split> parts_of_nerf[] = {{"transforms_train.json", Split::train},
                                                           {"transforms_val.json", Split::val},
                                                           {"transforms_test.json", Split::test}};
constexpr const char* no_list =
    "no cameras: a transforms.json, transforms_train.json, cameras.json or COLMAP model (in sparse/0, sparse, colmap, "
    "dense or the folder itself) is expected";

bool is_there(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error);
}

// What a file that is no list is; none if it may be JSON.
std::optional<ForeignFile> other_file(const fs::path& file) {
  std::array<char, 4096> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  const std::string_view head(bytes.data(), static_cast<std::size_t>(in.gcount()));
  const std::size_t first = head.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (first != head.npos && (head[first] == '{' || head[first] == '[')) return std::nullopt;
  return what_file_is(file.string(), head);
}

// The command that finds the cameras of a folder of pictures, or of a video.
std::string how_to_get_poses(const fs::path& pictures) {
  const fs::path whole = (pictures / "").lexically_normal().parent_path();
  const std::string name = is_there(pictures) ? pictures.stem().string() : whole.filename().string();
  return fmt::format(
      "the camera must be known for each picture. COLMAP finds the cameras:\n"
      "  vsplat poses {0} --output {1}\n"
      "Then give {1}. Masks leave the background out: PNG files in {1}/masks, named like the pictures, white where the "
      "object is. Any program can make them, such as rembg:\n"
      "  vsplat poses {0} --output {1} --mask-command 'rembg i -om'",
      shell_word(pictures.string()),
      shell_word(name.empty() || name == "." || name == ".." ? "posed" : name + "-posed"));
}

std::size_t pictures_in_folder(const fs::path& folder) {
  std::size_t out = 0;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    out += at->path().filename().string().front() != '.' && has_picture_ending(at->path());
  return out;
}

// Folders below this one that hold cameras; at most three.
std::vector<std::string> lists_below(const fs::path& folder) {
  std::vector<std::string> out;
  std::error_code error;
  int seen = 0;
  for (fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, error), end;
       !error && at != end && seen < 5000 && out.size() < 3; at.increment(error), ++seen) {
    if (at.depth() >= 3) at.disable_recursion_pending();
    std::error_code ignored;
    if (!at->is_directory(ignored) || !has_view_list(at->path())) continue;
    out.push_back(printable(at->path().string()));
    at.disable_recursion_pending();
  }
  std::sort(out.begin(), out.end());
  return out;
}

// For a message: two files of a COLMAP model whose names differ only in case. "" if there are none.
std::string doubled_names(const fs::path& folder) {
  for (const char* inside : {"sparse/0", "sparse", "colmap", "."}) {
    std::map<std::string, std::string> seen;
    std::error_code error;
    for (fs::directory_iterator at(folder / inside, error), end; !error && at != end; at.increment(error)) {
      const std::string name = at->path().filename().string(), plain = lower_case(name);
      if (!plain.starts_with("cameras.") && !plain.starts_with("images.")) continue;
      const auto [other, is_new] = seen.emplace(plain, name);
      if (!is_new)
        return fmt::format("{} and {} are both in {}, but COLMAP's file is called {}: keep one of them; ",
                           printable(std::min(name, other->second)), printable(std::max(name, other->second)),
                           printable((folder / inside).lexically_normal().string()), plain);
    }
  }
  return "";
}

[[noreturn]] void refuse_folder(const fs::path& folder) {
  const std::vector<std::string> below = lists_below(folder);
  if (!below.empty()) {
    std::string places;
    for (const std::string& place : below) places += (places.empty() ? "" : ", ") + place;
    fail(Status::file, "{}: {}; cameras lie in {}: give {}", folder.string(), no_list, places,
         below.size() == 1 ? "that folder" : "one of these folders");
  }
  for (const char* inside : {"images", "input", "."}) {
    const fs::path pictures = inside == std::string(".") ? folder : folder / inside;
    if (const std::size_t count = pictures_in_folder(pictures); count > 0)
      fail(Status::file, "{}: {}; {}{} has {} picture{}: {}", folder.string(), no_list, doubled_names(folder),
           pictures.string(), count, count == 1 ? "" : "s", how_to_get_poses(folder));
  }
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    names.push_back(printable(at->path().filename().string()));
  std::sort(names.begin(), names.end());
  std::string there = names.empty() ? "the folder is empty" : "it holds ";
  for (std::size_t i = 0; i < names.size() && i < 5; ++i) there += (i ? ", " : "") + names[i];
  if (names.size() > 5) there += fmt::format(" and {} more", names.size() - 5);
  fail(Status::file, "{}: {}; {}", folder.string(), no_list, there);
}

[[noreturn]] void refuse_file(const fs::path& file, const ForeignFile& other) {
  const std::string text = file.string(), kind = other.name;
  if (kind.find("picture") != std::string::npos) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    fail(Status::format, "{}: is {}, and a list of cameras is expected: {}", text, kind,
         has_view_list(folder)
             ? fmt::format("give its folder {}, and the picture's name as {}", folder.string(), Option::views)
             : how_to_get_poses(folder));
  }
  if (kind.starts_with("a video"))
    fail(Status::format, "{}: is {}, and a list of cameras is expected: {}", text, kind, how_to_get_poses(file));
  fail(Status::format,
       "{}: is {}, and a list of cameras is expected: a transforms.json, a cameras.json, a COLMAP model "
       "or the folder with one",
       text, kind);
}

ViewSet read_json_list(const fs::path& path, bool need_pictures) {
  const nlohmann::json root = read_json(path);
  if (root.is_array()) return parse_cameras_json(path, root, need_pictures);
  if (root.is_object() && root.contains("frames")) return parse_transforms_json(path, root, need_pictures);
  if (root.is_object() && root.contains("camera_path")) {
    if (need_pictures)
      fail(Status::input, "{}: is a path of cameras to draw from, without pictures; give it as cameras", path.string());
    warn(
        "{}: the viewer that writes such paths moves and scales the world of its transforms.json: if the pictures miss "
        "the scene, that is the reason",
        path.string());
    return parse_camera_path(path, root);
  }
  std::string fields;
  if (root.is_object())
    for (const auto& [name, value] : root.items())
      if (fields.size() < 80) fields += (fields.empty() ? "; its fields are " : ", ") + printable(name);
  fail(Status::format, "{}: neither a transforms.json (an object with frames) nor a cameras.json (a list of cameras){}",
       path.string(), fields);
}

// All parts as one set, or only the first existing part if the set is for reconstruction.
ViewSet read_nerf(const fs::path& folder, const ReadOptions& options) {
  ViewSet out;
  std::string unused;
  for (const auto& [name, split] : parts_of_nerf) {
    const fs::path file = in_any_case(folder, name);
    if (!is_there(file)) continue;
    if (!out.views.empty() && !options.all_splits) {
      unused += fmt::format("{}{}", unused.empty() ? "" : ", ", name);
      continue;
    }
    ViewSet part = read_json_list(file, options.need_pictures);
    for (ListedView& view : part.views) view.split = split;
    if (out.views.empty()) {
      out = std::move(part);
      continue;
    }
    out.views.insert(out.views.end(), part.views.begin(), part.views.end());
    out.lists_masks |= part.lists_masks;
  }
  if (!unused.empty())
    out.choices.push_back(fmt::format("{}: is read; {} beside it, which evaluation uses, {} not", out.source.string(),
                                      unused, unused.find(',') == std::string::npos ? "is" : "are"));
  return out;
}

bool is_nerf(const fs::path& folder) {
  return std::any_of(std::begin(parts_of_nerf), std::end(parts_of_nerf),
                     [&](const auto& part) { return is_there(in_any_case(folder, part.first)); });
}

ViewSet read_folder(const fs::path& folder, const ReadOptions& options) {
  std::vector<std::string> kinds;
  for (const char* name : {"transforms.json", "cameras.json"})
    if (is_there(in_any_case(folder, name))) kinds.emplace_back(name);
  if (is_nerf(folder)) kinds.emplace_back("transforms_train.json");
  const ColmapChoice model = choose_colmap_model(folder);
  if (!model.folder.empty()) kinds.push_back(model.folder.string());
  if (kinds.empty()) refuse_folder(folder);
  ViewSet out;
  if (kinds[0] == "transforms.json" || kinds[0] == "cameras.json") {
    out = read_json_list(in_any_case(folder, kinds[0]), options.need_pictures);
  } else if (kinds[0] == "transforms_train.json") {
    out = read_nerf(folder, options);
  } else {
    out = read_colmap(model.folder);
    if (!model.reason.empty()) out.choices.push_back(model.reason);
  }
  if (kinds.size() > 1)
    out.choices.push_back(fmt::format("{}: is read; {} is there, too, but is not read: name it to read it",
                                      out.source.string(), kinds[1]));
  return out;
}

}  // namespace

ViewSet read_view_list(const fs::path& path, const ReadOptions& options) {
  std::error_code error;
  if (!fs::exists(path, error)) fail(Status::file, "{}: no such file or folder", path.string());
  if (fs::is_directory(path, error)) return read_folder(path, options);
  const std::string name = path.filename().string();
  for (const char* part : {"cameras.bin", "images.bin", "points3D.bin", "cameras.txt", "images.txt", "points3D.txt"})
    if (lower_case(name) == lower_case(part))
      return read_colmap(path.has_parent_path() ? path.parent_path() : fs::path("."));
  if (is_there(path))
    if (const auto other = other_file(path)) refuse_file(path, *other);
  return read_json_list(path, options.need_pictures);
}

bool has_view_list(const fs::path& folder) {
  return is_there(in_any_case(folder, "transforms.json")) || is_there(in_any_case(folder, "cameras.json")) ||
         is_nerf(folder) || !find_colmap_model(folder).empty();
}

}  // namespace vsplat
